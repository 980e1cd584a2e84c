#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "clients/cli/connection.h"
#include "pepeseg/v1/job_service.pb.h"

namespace pepeseg::cli {

// Queues a training. `settings` are NAME=VALUE, see SetOption.
absl::StatusOr<v1::Job> StartTraining(const Connection& connection, const std::string& scene,
                                      const std::string& dataset,
                                      const std::vector<std::string>& settings);

}  // namespace pepeseg::cli
