# Sourced by the launchers beside it: which Python runs a node, and where it finds our modules.
# A launcher lies in PREFIX/lib/flea_diag, whether pip or colcon put it there.
prefix=$(cd "${0%/*}/../.." && pwd)

# A checkout in the current folder must not be run instead of what is installed (3.11 and newer).
export PYTHONSAFEPATH=1

python=python3
if [ -x "$prefix/bin/python3" ]; then
    python=$prefix/bin/python3 # a virtual environment: its Python finds everything
else
    # An egg-link holds one path: where `colcon build --symlink-install` left the modules.
    for modules in "$prefix"/lib/python3*/site-packages "$prefix"/lib/python3*/dist-packages \
        "$(head -qn 1 "$prefix"/lib/python3*/site-packages/flea?diag.egg-link 2>/dev/null)"; do
        [ -d "$modules/flea_diag" ] && PYTHONPATH=$modules${PYTHONPATH:+:$PYTHONPATH}
    done
    export PYTHONPATH
fi

# Ctrl-C waits until Python has taken it, a moment later; see flea_diag/wire/ending.py.
start() {
    if env --block-signal=INT,TERM true 2>/dev/null; then
        exec env --block-signal=INT,TERM "$python" -m flea_diag.nodes.main "$@"
    fi
    exec "$python" -m flea_diag.nodes.main "$@"
}
