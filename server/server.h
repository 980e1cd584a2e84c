#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "grpcpp/channel.h"
#include "server/access/access_options.h"
#include "server/jobs/launcher.h"
#include "server/rpc/stream_registry.h"
#include "server/store/quota.h"
#include "server/worker_protocol/job_spec.h"

namespace pepeseg {

struct ServerOptions {
  std::string listen = "127.0.0.1:0";  // HOST:PORT, port 0: a free one; or unix:PATH
  // Where AdminService listens, in the same form; empty: it is not served.
  std::string admin;
  bool insecure = false;    // listens beyond this machine, without encryption
  bool reflection = false;  // tells anybody what methods there are
  // Made when it is not there. With SQLite for one server at a time; servers that share a
  // PostgreSQL database share the directory, too.
  std::filesystem::path data;
  std::string database;  // Store::Open's; empty: sqlite:DATA/pepeseg.db
  AccessOptions access;  // TLS and keys, of both listeners
  Quota quota;           // of a project that has none of its own
  StreamLimits streams;
  LaunchOptions launch;  // how workers are started
  // HOST:PORT where Prometheus reads metrics, without encryption; empty: nowhere.
  std::string metrics;
  absl::Duration max_connection_age = absl::Hours(1);  // see ListenerLimits
  // When it stops, health says so for so long before it turns anybody away.
  absl::Duration drain = absl::ZeroDuration();
  // How often the server asks itself for its health over a new connection to `listen`. 0: never.
  absl::Duration self_probe = absl::Seconds(5);
  // Called once, on a thread of the server, after the self-probe has failed three times in a row:
  // no new client gets an answer any more, so the process should call Shutdown and be restarted. It
  // must not call Shutdown itself. Health says NOT_SERVING by then.
  std::function<void()> on_unreachable;
  std::filesystem::path worker;  // the pepeseg-worker program
  WorkerOptions workers;         // what the job specs say to workers
  // Folders of SAM's files (core/priors/sam/sam_files.h). `workers.sam`, where it is given, must be
  // good; else the first of these that has any is used if it is good.
  std::vector<std::filesystem::path> default_sam;
  std::string device = "auto";  // of jobs and queries, see OpenDevice
  int num_threads = 0;          // of a job and of a query; 0: as many as the machine has
  // Of the device, for a training, bytes; 0: what is free of it when the server starts. On a device
  // that is the host no more than WorkerMemory (server_parts.h).
  int64_t device_memory = 0;
  // Budgets of models in memory, bytes; 0: half of what the machine or the control group has, and
  // of the device's. On a device that is the host there is only the first.
  int64_t model_bytes = 0, model_device_bytes = 0;
};

// Whether HOST:PORT or unix:PATH can be reached from this machine only.
bool IsLoopback(const std::string& listen);

// Everything that serves: store, supervisor, models, services, listener.
class Server {
 public:
  // FAILED_PRECONDITION: a listener beyond this machine without TLS or without keys, and without
  // `insecure`; certificates that cannot be read or do not fit (the file is named); a data
  // directory that another server uses, a worker or priors command that is no program, a device
  // that cannot be had, files of SAM that are missing or differ from their digests.
  // INVALID_ARGUMENT, NOT_FOUND: see Lpips::Open.
  static absl::StatusOr<std::unique_ptr<Server>> Start(const ServerOptions& options);
  // Shutdown without grace, unless it was called.
  ~Server();

  int port() const;        // 0 for a unix socket
  int admin_port() const;  // likewise, and where there is none
  int metrics_port() const;
  // To the services without a socket.
  std::shared_ptr<grpc::Channel> InProcessChannel();
  // To AdminService; null where it is not served.
  std::shared_ptr<grpc::Channel> InProcessAdminChannel();

  // Health says NOT_SERVING; ServerOptions::drain later, or at `deadline` if that is sooner,
  // streams end with UNAVAILABLE, running jobs are stopped and queued for the next start, calls
  // under way get until `deadline`. Blocks; once.
  void Shutdown(absl::Time deadline);

 private:
  struct Parts;
  explicit Server(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace pepeseg
