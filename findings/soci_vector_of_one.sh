#!/usr/bin/env bash
# SOCI loses the row of a SELECT that has a parameter and reads into a vector of one element.
#
# SOCI 4.0.3 with its SQLite backend, as packaged by Debian 12. A bulk SELECT fills the vector and
# shrinks it to the number of rows. With one element and a bound scalar, such as a LIMIT that is passed
# as a parameter, got_data() is true, but the vector is left empty: code that asks for `limit` rows
# works for every limit but 1. Without a parameter, or with two elements, it is right. One would expect
# the size of the vector to make no difference.
#
# Seen (five rows 1 to 5; size of the vector before and after):
#   no parameter     1: 1 row, 1 element    2: 2 elements
#   number >= 2      1: got_data, 0 elements    2: 2 elements (2 3)
#   number <= 1      1: got_data, 0 elements    2: 1 element (1)
#
# Needs Debian 12's apt, a C++ compiler and about 5 MB. Fails if the behaviour changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
apt-get download -qq libsoci-dev=4.0.3-1 libsoci-core4.0=4.0.3-1 libsoci-sqlite3-4.0=4.0.3-1 \
  libsqlite3-0=3.40.1-2+deb12u2 libsqlite3-dev=3.40.1-2+deb12u2
for package in *.deb; do dpkg-deb -x "$package" .; done
libraries=$(dirname "$(find "$folder" -name 'libsoci_core.so.4.0')")

cat > rows.cc <<'SOURCE'
#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>

#include <cstdio>
#include <string>
#include <vector>

void Print(const char* what, soci::session& sql, const std::vector<int>& rows) {
  std::printf("%s: got_data %d, %zu elements\n", what, sql.got_data() ? 1 : 0, rows.size());
}

int main() {
  soci::session sql(soci::sqlite3, "dbname=:memory:");
  sql << "CREATE TABLE t (number INTEGER)";
  for (int i = 1; i <= 5; ++i) sql << "INSERT INTO t VALUES (:i)", soci::use(i);
  for (const int size : {1, 2}) {
    std::printf("vector of %d\n", size);
    std::vector<int> all(size), later(size), first(size);
    sql << "SELECT number FROM t ORDER BY number", soci::into(all);
    Print("  no parameter", sql, all);
    int least = 2, most = 1;
    sql << "SELECT number FROM t WHERE number >= :least ORDER BY number", soci::use(least),
        soci::into(later);
    Print("  number >= 2", sql, later);
    sql << "SELECT number FROM t WHERE number <= :most ORDER BY number", soci::use(most),
        soci::into(first);
    Print("  number <= 1", sql, first);
  }
}
SOURCE
g++ -std=c++17 -I usr/include -o rows rows.cc -L"$libraries" -lsoci_core -lsoci_sqlite3 \
  -Wl,--unresolved-symbols=ignore-in-shared-libs
LD_LIBRARY_PATH=$libraries ./rows | tee seen
diff seen - <<'EXPECTED'
vector of 1
  no parameter: got_data 1, 1 elements
  number >= 2: got_data 1, 0 elements
  number <= 1: got_data 1, 0 elements
vector of 2
  no parameter: got_data 1, 2 elements
  number >= 2: got_data 1, 2 elements
  number <= 1: got_data 1, 1 elements
EXPECTED
echo 'as described'
