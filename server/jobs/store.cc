#include "server/jobs/store.h"

#include "core/status_macros.h"
#include "server/jobs/database.h"

namespace pepeseg {

Store::Store(std::unique_ptr<Database> database) : database_(std::move(database)) {}
Store::~Store() = default;

absl::StatusOr<std::unique_ptr<Store>> Store::Open(const std::string& url) {
  ASSIGN_OR_RETURN(std::unique_ptr<Database> database, Database::Open(url));
  return std::unique_ptr<Store>(new Store(std::move(database)));
}

}  // namespace pepeseg
