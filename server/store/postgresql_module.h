#pragma once

#include <string>

#include "server/store/soci.h"

namespace pepeseg {

// Contents of the module "postgresql" (core/base/module.h): SOCI's part for PostgreSQL. It is
// loaded for such a database only, since libpq brings LDAP and Kerberos.
struct PostgresqlModule {
  const soci::backend_factory* factory;
  // Returns the SQLSTATE of an error of PostgreSQL; empty for other errors.
  std::string (*sql_state)(const soci::soci_error& error);
};

// The module's function: returns the same object in each call.
using GetPostgresqlFn = const PostgresqlModule*();
inline constexpr char kGetPostgresql[] = "PepesegGetPostgresql";  // name of the function

}  // namespace pepeseg
