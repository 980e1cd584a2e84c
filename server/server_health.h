#pragma once

#include <memory>

#include "server/observe/health_monitor.h"
#include "server/rpc/service_context.h"

namespace pepeseg {

// What the services of a server stand on: the database all of them; room on the disk uploads and
// jobs; the device questions. The server as a whole, "", serves while the database and the device
// work, so that a full disk does not end questions.
std::unique_ptr<HealthMonitor> MakeHealthMonitor(const ServiceContext& context);

}  // namespace pepeseg
