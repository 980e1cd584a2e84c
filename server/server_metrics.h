#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/observe/exposition.h"
#include "server/observe/job_metrics.h"
#include "server/observe/rpc_metrics.h"
#include "server/services/operations.h"

namespace pepeseg {

// Everything that a server measures of itself, and where it can be read.
class ServerMetrics {
 public:
  ServerMetrics();

  RpcMetrics& rpc() { return *rpc_; }
  JobMetrics& jobs() { return *jobs_; }

  // Errors as Exposition::Start. `operations` must outlive this, or Stop().
  absl::Status Expose(const std::string& listen, const Operations& operations);
  // Nobody reads any more when it returns.
  void Stop() { exposition_.reset(); }
  int port() const { return exposition_ == nullptr ? 0 : exposition_->port(); }

 private:
  const std::shared_ptr<RpcMetrics> rpc_;
  const std::shared_ptr<JobMetrics> jobs_;
  std::shared_ptr<prometheus::Collectable> gauges_;
  std::unique_ptr<Exposition> exposition_;
};

// As "pepeseg.v1.SceneService"; the admin service is not among them.
const std::vector<std::string>& ServiceNames();

}  // namespace pepeseg
