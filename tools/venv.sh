# Sourced by the tools: make_venv EXTRAS makes one virtual environment, anew only when pyproject.toml has changed.
make_venv() {
    local extras="$1" stamp=".venv/.made-of" sum
    sum="$(sha256sum pyproject.toml | cut -d' ' -f1)"
    case "$(cat "$stamp" 2>/dev/null || true)" in
        "$sum $extras" | "$sum test") ;;
        *)
            [ -x .venv/bin/python ] || "${PYTHON:-python3}" -m venv .venv
            echo "installing gcodectl into .venv (once)" >&2
            .venv/bin/python -m pip install --quiet --disable-pip-version-check -e ".${extras:+[$extras]}"
            echo "$sum $extras" > "$stamp"
            ;;
    esac
    source .venv/bin/activate
}
