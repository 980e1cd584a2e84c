#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/observe/exposition.h"
#include "server/observe/metrics.h"
#include "server/services/operations.h"

namespace pepeseg {

// The metrics of a server, and the listener where Prometheus reads them. Those of rpc() and jobs()
// are counted as calls and jobs proceed; all others are read when Prometheus asks.
class ServerMetrics {
 public:
  ServerMetrics();

  RpcMetrics& rpc() { return *rpc_; }
  JobMetrics& jobs() { return *jobs_; }

  // Serves all metrics on HOST:PORT. `operations` must live until Stop() or the end of this object.
  // Errors as Exposition::Start.
  absl::Status Expose(const std::string& listen, const Operations& operations);
  // Closes the listener. Blocks until scrapes in progress have finished.
  void Stop() { exposition_.reset(); }
  // Returns the listener's port; 0: there is no listener.
  int port() const { return exposition_ == nullptr ? 0 : exposition_->port(); }

 private:
  const std::shared_ptr<RpcMetrics> rpc_;
  const std::shared_ptr<JobMetrics> jobs_;
  std::shared_ptr<prometheus::Collectable> gauges_;
  std::unique_ptr<Exposition> exposition_;
};

// Returns the full names of the services, such as "pepeseg.v1.SceneService", without the admin
// service.
const std::vector<std::string>& ServiceNames();

}  // namespace pepeseg
