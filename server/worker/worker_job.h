#pragma once

#include <atomic>
#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "server/worker_protocol/event_log.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {

// What a signal handler may touch.
struct StopSwitch {
  std::atomic<bool> stop = false;    // set by the handler: end at the next step
  std::atomic<bool> polled = false;  // set by the job: somebody looks at `stop` now
};
static_assert(std::atomic<bool>::is_always_lock_free);

// While somebody looks at the switch, a signal only sets it.
class Polling {
 public:
  explicit Polling(StopSwitch& stop) : stop_(stop) { stop_.polled = true; }
  ~Polling() { stop_.polled = false; }
  Polling(const Polling&) = delete;
  Polling& operator=(const Polling&) = delete;

 private:
  StopSwitch& stop_;
};

// The operator's program that makes masks and depth maps, see worker_priors_command.h.
struct PriorsCommand {
  std::filesystem::path program;  // empty: there is none
  absl::Duration time_limit = absl::Hours(1);
};

struct WorkerJob {
  const JobFolder& folder;
  const JobSpec& spec;
  EventLogWriter& log;
  StopSwitch& stop;
  std::filesystem::path lpips_weights;  // ONNX, see core/evaluate/lpips.h; empty: no LPIPS
  std::string colmap = "colmap";        // a path, or a name that is looked for in PATH
  PriorsCommand priors;
  // Gets the digests of inputs whose stored bytes are damaged; see VerifyInputs.
  std::vector<std::string>& damaged_inputs;
  // Folder of SAM's files, see core/priors/sam/sam_files.h; empty: there is none.
  std::filesystem::path sam = {};
};

// The stages of a training, one after the other: prepare -> sfm -> priors (worker_inputs.h) ->
// reconstruct -> evaluate -> features -> index. The
// model stands in folder.attempt(spec.fence) when it answers OK. Stage one's result is kept beside
// it until then, so that an attempt after a stop of the server need not train it again.
// INVALID_ARGUMENT names the file, of the dataset or of the weights, that is wrong; DATA_LOSS one
// whose stored bytes are damaged (worker_verify.h); CANCELLED: `stop` was set.
absl::StatusOr<JobResult> RunWorkerJob(const WorkerJob& job);

}  // namespace pepeseg
