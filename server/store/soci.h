#pragma once

// SOCI without its Boost extras. Debian's soci-config.h requires Boost's headers, which libsoci-dev
// does not depend on. They only add overloads of into() and use(), so leaving them out keeps the
// library's ABI. Include this file, never soci/*.h.
#define SOCICONFIG_H_INCLUDED
#define SOCI_HAVE_CXX11
#define SOCI_HAVE_VISIBILITY_SUPPORT

#include <soci/postgresql/soci-postgresql.h>
#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>
