# Sourced by the other scripts: makes .venv on first use and keeps it up to date.
# Sets $python. A ROS installation sourced in this shell is deliberately ignored: its rclpy would
# conflict with the one in .venv.

unset PYTHONPATH LD_LIBRARY_PATH AMENT_PREFIX_PATH RMW_IMPLEMENTATION _ROS_WHEELS_BOOTSTRAP_COMPLETE
# Else each of the many processes of a run or of the tests would compile all sources again.
unset PYTHONDONTWRITEBYTECODE
export PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_INPUT=1 PYTHONUNBUFFERED=1

venv=${venv:-$root/.venv}
python=$venv/bin/python3

say() { printf '%s\n' "$*" >&2; }

fail() {
    say "$*"
    exit 2
}

base_python() {
    base=${PYTHON:-python3}
    command -v "$base" >/dev/null || fail "no $base found: install Python 3.10 or newer"
    "$base" -c 'import sys; sys.exit(sys.version_info < (3, 10))' ||
        fail "$("$base" -V) is too old, 3.10 is the oldest supported: set PYTHON=python3.12, say"
    "$base" -c 'import ensurepip, venv' 2>/dev/null ||
        fail "$("$base" -V) has no venv module: apt-get install python3-venv"
}

make_venv() {
    [ -x "$python" ] && "$python" -c '' 2>/dev/null && return
    base_python
    say "making .venv with $("$base" -V) (first use only)"
    "$base" -m venv --clear "$venv" || fail "cannot make $venv: is the disk full or read-only?"
}

# The sum over names and contents of the files given by a find expression.
sum_of() { find "$@" -type f ! -path '*/__pycache__/*' -print0 | sort -z | xargs -0 sha256sum | sha256sum; }

# Runs an installer and says for how long, so that a slow line does not look like a hang.
followed() {
    "$@" >"$venv/install.log" 2>&1 &
    installer=$!
    waited=0
    while kill -0 $installer 2>/dev/null; do
        [ -t 2 ] && printf '\r  %s s … ' $waited >&2
        sleep 1
        waited=$((waited + 1))
    done
    [ -t 2 ] && printf '\r\033[K' >&2
    wait $installer
}

get_uv() {
    "$python" -m uv --version ||
        "$python" -m pip install --retries 1 --constraint "$constraints" uv
}

# uv takes a tenth of pip's time. Where there is none, or it cannot install from the index that pip
# is told to use, pip installs the same. Nothing is compiled ahead: most is never imported.
pip_install() {
    constraints=${constraints:-$root/constraints.txt}
    index=${PIP_INDEX_URL:-$("$python" -m pip config get global.index-url 2>/dev/null)}
    [ -z "$index" ] || export UV_DEFAULT_INDEX="${UV_DEFAULT_INDEX:-$index}"
    set -- --no-build-isolation --constraint "$constraints" "$@"
    get_uv >/dev/null 2>&1 &&
        followed "$python" -m uv pip install --python "$python" --reinstall-package flea_diag "$@" &&
        return
    followed "$python" -m pip install --progress-bar off --no-compile "$@" || {
        grep -iE '(^|  )error|Errno' "$venv/install.log" | tail -n 5 >&2
        fail "pip failed (is the package index reachable, the disk full?): see $venv/install.log"
    }
}

# What flea_diag itself is made from.
sources_sum() {
    (cd "$root" && sum_of flea_diag flea_sim_driver config launch launcher resource \
        package.xml setup.py)
}

# Leftovers of an earlier build would be installed too, including deleted modules.
forget_build() { rm -rf "$root/build/lib" "$root"/build/bdist.*; }

# Whether some installation of the dependencies that are $wanted had all of these extras.
has_extras() {
    for stamp in "$venv"/.dependencies-*; do
        [ "$(cat "$stamp" 2>/dev/null)" = "$wanted" ] || continue
        missing=$(printf '%s' "$1" | tr , '\n' | grep -vxF "$(printf '%s' "${stamp##*.dependencies-}" | tr , '\n')")
        [ -z "$missing" ] && return
    done
    return 1
}

# $1: extras, e.g. numba or numba,test. A plain install: an editable one leaves out the data
# files by which ros2 and the nodes find each other. Both steps do nothing when nothing changed.
install() {
    make_venv
    wanted=$(cd "$root" && sum_of constraints.txt setup.py)
    if ! has_extras "$1"; then
        say "installing ROS 2, flea_diag and the other dependencies [$1] into .venv (a minute or two)"
        pip_install setuptools
        forget_build
        installed=$(sources_sum)
        pip_install "$root[$1]"
        printf '%s' "$wanted" >"$venv/.dependencies-$1"
        printf '%s' "$installed" >"$venv/.sources"
    fi
    wanted=$(sources_sum)
    if [ "$(cat "$venv/.sources" 2>/dev/null)" != "$wanted" ] || [ ! -x "$venv/bin/flea" ]; then
        say "installing flea_diag into .venv"
        forget_build
        pip_install --no-deps --force-reinstall "$root"
        printf '%s' "$wanted" >"$venv/.sources"
    fi
}

# Compiles what the nodes need, once an installation: the first launch is then as quick as any other.
# Code is kept by its content in the user's cache: a source tree and the tests take it from there.
warm_up() {
    [ "$(cat "$venv/.warm" 2>/dev/null)" = "$(cat "$venv/.sources")" ] && return
    say "compiling ahead what is new (up to half a minute, after an installation only)"
    # From elsewhere, for what is installed is meant and not the sources in this folder.
    (cd / && "$python" -m flea_diag.tools.main warm-up) >&2 || fail "flea warm-up failed"
    cp "$venv/.sources" "$venv/.warm"
}
