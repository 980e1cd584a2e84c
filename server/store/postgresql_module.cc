// The module "postgresql".
#include "server/store/postgresql_module.h"

#include <soci/postgresql/soci-postgresql.h>

#include <string>

namespace pepeseg {
namespace {

std::string SqlState(const soci::soci_error& error) {
  const auto* postgresql = dynamic_cast<const soci::postgresql_soci_error*>(&error);
  return postgresql == nullptr ? "" : postgresql->sqlstate();
}

}  // namespace
}  // namespace pepeseg

extern "C" __attribute__((visibility("default"))) const pepeseg::PostgresqlModule*
PepesegGetPostgresql() {
  static const pepeseg::PostgresqlModule module{&soci::postgresql, pepeseg::SqlState};
  return &module;
}
