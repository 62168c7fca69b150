"""Down the serial link: the line protocol of both roles, the streamer, uploads."""
