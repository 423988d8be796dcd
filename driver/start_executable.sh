#!/bin/sh
# The script `thud` of a wheel: it becomes the executable, which stands in the package.
here=$(readlink -f "$0" 2>/dev/null || echo "$0")
here=${here%/*}
for packages in "$here"/../lib*/python*/*-packages "$here/.."; do
  [ -x "$packages/thud/lib/thud" ] && exec "$packages/thud/lib/thud" "$@"
done
echo "thud: the package thud is not installed beside $here" >&2
exit 1
