#pragma once

#include <mutex>
#include <string>

#include "absl/time/time.h"
#include "server/observe/health_monitor.h"
#include "server/rpc/service_context.h"

namespace pepeseg {

// A server as who operates it sees it: what it is, and whether it drains. Thread safe.
class Operations {
 public:
  // Both outlive it, and so does what `context` points to; its pools are those of the services that
  // drain.
  Operations(const ServiceContext& context, HealthMonitor& health);

  // Draining: health says NOT_SERVING, calls and streams that come are refused, no job is begun;
  // what is under way goes on.
  void SetDraining(bool draining);

  const ServiceContext& context() const { return context_; }
  const HealthMonitor& health() const { return health_; }
  absl::Time start_time() const { return start_time_; }
  static std::string version();

 private:
  const ServiceContext context_;
  HealthMonitor& health_;
  const absl::Time start_time_;
  std::mutex mutex_;  // one who sets it after the other
};

}  // namespace pepeseg
