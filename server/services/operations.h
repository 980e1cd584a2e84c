#pragma once

#include <mutex>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "pepeseg/v1/server_status.pb.h"
#include "server/jobs/supervisor.h"
#include "server/observe/health_monitor.h"
#include "server/rpc/call_runner.h"
#include "server/services/model_loader.h"

namespace pepeseg {

// A server as its operator sees it: what it is, what it does, and whether it drains. Thread safe.
class Operations {
 public:
  // The parts that are shown and drained; all must outlive the object.
  struct Dependencies {
    const CallRunner& runner;  // of the services that drain
    ModelLoader& models;
    Supervisor& supervisor;
    HealthMonitor& health;
    const v1::ServerStatus::FindSources& find_sources;  // set before FillStatus is called
  };
  explicit Operations(const Dependencies& deps);

  // Begins or ends draining. While it drains, health reports NOT_SERVING, new calls and streams are
  // refused and no job is started; calls and jobs under way continue.
  void SetDraining(bool draining);

  // Describes what the server is and does now. Blocks on the store.
  absl::Status FillStatus(v1::ServerStatus* response) const;

  const CallRunner& runner() const { return deps_.runner; }
  ModelLoader& models() const { return deps_.models; }
  Supervisor& supervisor() const { return deps_.supervisor; }
  const HealthMonitor& health() const { return deps_.health; }
  absl::Time start_time() const { return start_time_; }
  static std::string version();
  // Returns the names of the devices, separated by ", ".
  std::string DeviceNames() const;

 private:
  void FillProcess(v1::ServerStatus* response) const;
  void FillDevices(v1::ServerStatus* response) const;
  absl::Status FillJobs(v1::ServerStatus* response) const;

  const Dependencies deps_;
  const absl::Time start_time_;
  std::mutex draining_mutex_;  // serialises SetDraining
};

}  // namespace pepeseg
