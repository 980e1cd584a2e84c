#include "server/jobs/failed_photographs.h"

namespace pepeseg {
namespace {

constexpr absl::Duration kMaxAge = absl::Minutes(10);
constexpr size_t kMaxFailures = 10'000;

}  // namespace

absl::Status FailedPhotographs::Find(const std::string& key, absl::Time now) const {
  const std::lock_guard lock(mutex_);
  const auto found = failures_.find(key);
  if (found == failures_.end() || now - found->second.when > kMaxAge) return absl::OkStatus();
  return found->second.error;
}

void FailedPhotographs::Remember(const std::string& key, const absl::Status& error,
                                 absl::Time now) {
  const std::lock_guard lock(mutex_);
  // Simple and rare: those that are forgotten cost one attempt each.
  if (failures_.size() >= kMaxFailures) failures_.clear();
  failures_[key] = {error, now};
}

}  // namespace pepeseg
