#pragma once

#include <mutex>
#include <string>
#include <vector>

#include "absl/time/clock.h"
#include "absl/time/time.h"

namespace pepeseg {

// A device that jobs run on, one at a time.
struct JobDevice {
  std::string id = "cpu";  // Device::id, which the worker opens
  std::string name;        // Device::name, stored with each job
  int num_threads = 0;     // CPU threads of the job; 0: one per core
};

// Which job runs on each device, and for how long jobs have. Thread safe; does not block.
class DeviceUse {
 public:
  struct Use {
    std::string job;  // id; empty: none
    absl::Duration job_time = absl::ZeroDuration();
  };
  explicit DeviceUse(size_t num_devices) : uses_(num_devices), since_(num_devices) {}

  // Sets the job of each device; empty: none. Further elements are ignored.
  void Set(const std::vector<std::string>& jobs);
  // Returns the use of each device up to now.
  std::vector<Use> Get() const;

 private:
  mutable std::mutex mutex_;  // guards all below
  std::vector<Use> uses_;     // up to the start of the job that runs
  std::vector<absl::Time> since_;
};

}  // namespace pepeseg
