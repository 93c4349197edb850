# Sourced by the launchers beside it: which Python runs a node, and where it finds our modules.
# A launcher lies in PREFIX/lib/flea_diag, whether pip or colcon put it there.
prefix=$(cd "${0%/*}/../.." && pwd)

# A virtual environment has its own Python; a --prefix or colcon installation has none.
python=python3
[ -x "$prefix/bin/python3" ] && python=$prefix/bin/python3

# Only where that Python would not look by itself. The last file is what colcon leaves behind
# with --symlink-install: "prepend-non-duplicate;PYTHONPATH;/path/to/build/flea_diag".
if [ "$python" = python3 ]; then
    for modules in "$prefix"/lib/python3*/site-packages "$prefix"/lib/python3*/dist-packages \
        "$(sed -n 's/^prepend[^;]*;PYTHONPATH;//p' \
            "$prefix/share/flea_diag/hook/pythonpath_develop.dsv" 2>/dev/null)"; do
        [ -d "$modules/flea_diag" ] && PYTHONPATH=$modules${PYTHONPATH:+:$PYTHONPATH}
    done
    export PYTHONPATH
fi
