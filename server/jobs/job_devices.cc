#include "server/jobs/job_devices.h"

namespace pepeseg {

void DeviceUse::Set(const std::vector<std::string>& jobs) {
  const absl::Time now = absl::Now();
  const std::lock_guard lock(mutex_);
  for (size_t i = 0; i < uses_.size(); ++i) {
    if (uses_[i].job == jobs[i]) continue;
    if (!uses_[i].job.empty()) uses_[i].job_time += now - since_[i];
    uses_[i].job = jobs[i];
    since_[i] = now;
  }
}

std::vector<DeviceUse::Use> DeviceUse::Get() const {
  const absl::Time now = absl::Now();
  const std::lock_guard lock(mutex_);
  std::vector<Use> uses = uses_;
  for (size_t i = 0; i < uses.size(); ++i) {
    if (!uses[i].job.empty()) uses[i].job_time += now - since_[i];
  }
  return uses;
}

}  // namespace pepeseg
