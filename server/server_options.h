#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "absl/time/time.h"
#include "server/access/access_options.h"
#include "server/jobs/launcher.h"
#include "server/rpc/stream_registry.h"
#include "server/store/quota.h"
#include "server/worker_protocol/job_spec.h"

namespace pepeseg {

// Where Debian's wordnet-base puts its files.
inline constexpr char kDefaultWordNet[] = "/usr/share/wordnet";

struct ServerOptions {
  std::string listen = "127.0.0.1:0";  // HOST:PORT (port 0: a free one) or unix:PATH
  // Address of AdminService, in the same form; empty: it is not served.
  std::string admin;
  bool insecure = false;    // allows listeners beyond this machine without encryption or keys
  bool reflection = false;  // serves gRPC reflection, to callers with a key
  // Data directory, created if it is missing. With SQLite for one server at a time; servers that
  // share a PostgreSQL database must share the directory, too.
  std::filesystem::path data;
  std::string database;  // URL as Store::Open takes it; empty: sqlite:DATA/pepeseg.db
  AccessOptions access;  // TLS and keys of both listeners
  Quota quota;           // quotas of a project that has none of its own
  StreamLimits streams;
  LaunchOptions launch;  // how workers are started
  // HOST:PORT where Prometheus reads metrics, without encryption; empty: they are not served.
  std::string metrics;
  absl::Duration max_connection_age = absl::Hours(1);  // see ListenerLimits
  // Time during which a stopping server reports NOT_SERVING before it refuses calls.
  absl::Duration drain = absl::ZeroDuration();
  // Interval at which the server checks its health over a new connection to `listen`. 0: never.
  absl::Duration self_probe = absl::Seconds(5);
  // Called once, on a thread of the server, after the self-probe has failed three times in a row.
  // New clients then get no answer, so the process should call Shutdown and be restarted. Must not
  // call Shutdown itself. Health reports NOT_SERVING by then. May be empty.
  std::function<void()> on_unreachable;
  std::filesystem::path worker;  // the pepeseg-worker program
  WorkerOptions workers;         // copied into each job's spec
  // Folders in which SAM's files are looked for (CheckSamFiles) if `workers.sam` is
  // empty: the first that has any is used if they are good. Those in `workers.sam` must be good.
  std::vector<std::filesystem::path> default_sam;
  // Folder of the detector of words (CheckDetectorFiles), which must be good. If it is empty, the
  // first folder of `default_detector` that has one is used if it is good.
  std::filesystem::path detector;
  std::vector<std::filesystem::path> default_detector;
  // Program that finds what a text names in photographs (text_task.h), as FindProgram takes it;
  // empty: none. Its time limit for one text, seconds.
  std::string text_command;
  int64_t text_seconds = 120;
  // Folder of WordNet's files, whose synonyms find labels; empty: none. The default need not exist.
  std::filesystem::path wordnet = kDefaultWordNet;
  std::string devices = "auto";  // devices of jobs and queries, as OpenDevices takes them
  // CPU threads of a job and of a query; 0: the cores, divided among the devices.
  int num_threads = 0;
  // Maximum device memory of a training, bytes. 0: what is free when the server starts. At most
  // WorkerMemory() (server_parts.h) on a device whose memory is the host's.
  int64_t device_memory = 0;
  // Budgets of models in host and device memory, bytes. 0: half of the memory of the machine or
  // control group, and of the device. On a device whose memory is the host's, only the first
  // counts.
  int64_t model_bytes = 0, model_device_bytes = 0;
};

}  // namespace pepeseg
