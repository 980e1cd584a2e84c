#include "server/services/operations.h"

#include <spdlog/spdlog.h>

#include "absl/time/clock.h"

namespace pepeseg {

Operations::Operations(const ServiceContext& context, HealthMonitor& health)
    : context_(context), health_(health), start_time_(absl::Now()) {}

void Operations::SetDraining(bool draining) {
  const std::lock_guard lock(mutex_);
  if (health_.draining() != draining) {
    spdlog::info(draining ? "draining: nothing new is taken" : "no longer draining");
  }
  health_.SetDraining(draining);
  for (WorkerPool* pool :
       {context_.pool, context_.upload_pool, context_.query_pool, context_.evaluation_pool}) {
    pool->SetDraining(draining);
  }
  context_.streams->SetDraining(draining);
  draining ? context_.supervisor->StopClaiming() : context_.supervisor->ResumeClaiming();
}

std::string Operations::version() { return PEPESEG_VERSION; }

}  // namespace pepeseg
