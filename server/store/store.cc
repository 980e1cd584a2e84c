#include "server/store/store.h"

#include "core/base/status_macros.h"
#include "server/store/database.h"

namespace pepeseg {

Store::Store(std::unique_ptr<Database> database, Holder holder)
    : database_(std::move(database)), holder_(std::move(holder)) {}
Store::~Store() = default;

absl::StatusOr<std::unique_ptr<Store>> Store::Open(const std::string& url, Holder holder) {
  ASSIGN_OR_RETURN(std::unique_ptr<Database> database, Database::Open(url));
  return std::unique_ptr<Store>(new Store(std::move(database), std::move(holder)));
}

absl::StatusOr<std::unique_ptr<Store>> Store::Open(const std::string& url) {
  return Open(url, Holder());
}

bool Store::shared() const { return database_->shared(); }

}  // namespace pepeseg
