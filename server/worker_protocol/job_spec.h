#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/training_options.pb.h"

// The order of a server to a worker, and the worker's answer. Both are JSON files in the job's
// folder (job_folder.h).
namespace pepeseg {

// The operator's settings of workers, the same for each job of a server. Each spec has a copy.
struct WorkerOptions {
  // Whether a sandbox limits a worker to what its job needs (worker/sandbox/worker_sandbox.h).
  bool sandbox = true;
  // Absolute paths of further files and folders that a sandboxed worker may read and execute.
  std::vector<std::string> sandbox_reads;
  // Names of variables of the server's environment that workers get in addition to
  // JobEnvironment's.
  std::vector<std::string> pass_environment;
  std::string colmap = "colmap";  // path of COLMAP, or its name in PATH
  // Path of the program that makes masks and depth maps (core/train/priors_command.h); empty: none.
  std::string priors_command;
  int64_t priors_seconds = 3600;  // time limit of that program for one job
  // Folder of SAM's files (CheckSamFiles), which workers verify before they use them;
  // empty: none.
  std::filesystem::path sam;
  bool keep_embeddings = true;          // of photographs by SAM, with the model
  std::filesystem::path lpips_weights;  // ONNX file, see core/evaluate/lpips.h; empty: no LPIPS
  std::string log_format = "text";      // format of the worker's log, as LogFormatOf takes it

  bool operator==(const WorkerOptions&) const = default;
};

// A file of the dataset.
struct JobSpecFile {
  std::string name;    // the client's path of the file, for matching and errors
  int kind = 0;        // pepeseg.v1.FileKind
  std::string path;    // path of the stored bytes
  std::string sha256;  // digest of the stored bytes: 64 lower-case hex digits
};

// What one attempt of a job has to do. The worker's command line only names the folder, the fence
// and the parent process; everything else is here.
struct JobSpec {
  std::string job;
  int64_t fence = 0;
  std::vector<JobSpecFile> files;
  v1::TrainingOptions options;  // the options in effect: every field is present
  std::string device;           // Device::id; the attempt fails when it cannot be opened
  int num_threads = 0;          // CPU threads; 0: one per core
  // A stage saves its state after this many seconds or steps, whichever comes first.
  int64_t checkpoint_seconds = 60;
  int64_t checkpoint_steps = 1000;
  // Maximum host memory, bytes. 0: all memory of the machine or control group.
  int64_t memory_limit = 0;
  // W3C trace context of the request that created the job; empty: unknown.
  std::string traceparent;
  // Lease duration: the worker ends when lease-FENCE is not touched for this long (heartbeat.h). 0:
  // no other server can claim the job.
  int64_t lease_seconds = 0;
  WorkerOptions worker;
};

// How an attempt ended. With an error only `status` and `damaged` are set.
struct JobResult {
  absl::Status status;
  std::map<std::string, double> metrics;  // by name, as Model.metrics in the contract
  int64_t num_gaussians = 0;
  int64_t num_bytes = 0;  // total size of the model's files
  // Origin of "poses", "masks" and "depth", as Model.sources in the contract.
  std::map<std::string, std::string> sources;
  // With DATA_LOSS: SHA-256 of the files whose stored bytes are damaged or missing.
  std::vector<std::string> damaged;
};

// Exit codes of the worker. kFailed and kCancelled come with a result, unless it could not be
// written. Any other code is a crash.
enum class WorkerExit { kSucceeded = 0, kFailed = 1, kBadSpec = 2, kCancelled = 3, kLeaseLost = 4 };

// Formats metrics as a JSON object. Leaves out those that are not finite.
std::string MetricsToJson(const std::map<std::string, double>& metrics);
// Formats sources as a JSON object. Replaces bytes that are not UTF-8.
std::string SourcesToJson(const std::map<std::string, std::string>& sources);

// Formats a spec as a JSON object. INTERNAL: the training options have no JSON form.
absl::StatusOr<std::string> FormatJobSpec(const JobSpec& spec);
// Parses the text of `file`. DATA_LOSS, naming the file: it is not what FormatJobSpec writes.
absl::StatusOr<JobSpec> ParseJobSpec(const std::filesystem::path& file, const std::string& text);

// Formats a result as a JSON object.
std::string FormatJobResult(const JobResult& result);
// Parses the text of `file`, which is a worker's and is not trusted: the texts of the result are
// ClientTexts, and it has at most 1,000 metrics and sources each. DATA_LOSS, naming the file: it is
// not a result.
absl::StatusOr<JobResult> ParseJobResult(const std::filesystem::path& file,
                                         const std::string& text);

}  // namespace pepeseg
