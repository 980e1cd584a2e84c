#include "server/worker/worker_job.h"

#include <google/protobuf/util/json_util.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>

#include "absl/strings/numbers.h"
#include "core/base/status_macros.h"
#include "core/train/train.h"
#include "server/api/convert.h"
#include "server/worker/job_observer.h"
#include "server/worker/sandbox/worker_limits.h"
#include "server/worker_protocol/device.h"

namespace pepeseg {
namespace {

// Returns N for "cuda:N", and 0 for "cuda" (worker_protocol/device.h); nothing for "cpu".
std::optional<int> CudaDevice(const std::string& device) {
  int number = 0;
  if (!device.starts_with("cuda")) return std::nullopt;
  return absl::SimpleAtoi(device.substr(std::min(device.size(), size_t{5})), &number) ? number : 0;
}

// Returns the folders of this attempt and, as those of earlier runs, of all attempts with a lower
// fence, the newest first.
TrainingFolders FoldersOf(const JobFolder& folder, int64_t fence) {
  TrainingFolders folders;
  folders.run = folder.attempt(fence);
  // Attempts that left nothing have no folder; the stages skip those.
  while (--fence > 0) folders.earlier.push_back(folder.attempt(fence));
  folders.priors = folder.priors();
  folders.sfm_log = folder.sfm_log();
  return folders;
}

TrainingTools ToolsOf(const JobSpec& spec) {
  TrainingTools tools;
  tools.colmap = spec.worker.colmap;
  tools.priors_command = {spec.worker.priors_command, absl::Seconds(spec.worker.priors_seconds)};
  tools.sam = spec.worker.sam;
  tools.sam_cuda_device = CudaDevice(spec.device);
  tools.lpips_weights = spec.worker.lpips_weights;
  tools.num_threads = spec.num_threads;
  tools.memory_limit = MemoryLimit();
  return tools;
}

// Returns metadata of the model that the pipeline does not know: job, version, options.
std::map<std::string, std::string> FactsOf(const JobSpec& spec, const TrainingSettings& settings) {
  std::map<std::string, std::string> facts = {{"job", spec.job}, {"version", PEPESEG_VERSION}};
  std::string options;
  if (google::protobuf::util::MessageToJsonString(ToProto(settings), &options).ok()) {
    facts["options"] = options;
  }
  return facts;
}

JobResult ResultOf(TrainedModel trained, int64_t num_bytes) {
  JobResult result;
  result.metrics = std::move(trained.model.metrics);
  result.sources = std::move(trained.sources);
  result.num_gaussians = trained.model.gaussians.count;
  result.num_bytes = num_bytes;
  return result;
}

absl::StatusOr<JobResult> TrainJob(const WorkerJob& job, const TrainingSettings& settings,
                                   JobObserver& observer) {
  ASSIGN_OR_RETURN(TrainingInputs inputs, TrainingInputsOf(job.folder, job.spec));
  inputs.facts = FactsOf(job.spec, settings);
  ASSIGN_OR_RETURN(const Device device, OpenDevice(job.spec.device, job.spec.num_threads));
  spdlog::info("computing on {}", device.backend->name());
  ASSIGN_OR_RETURN(TrainedModel trained, Train(inputs, settings, *device.backend, observer));
  // A model's folder must not have folders in it, not even empty ones (JobFolder::TakeModel).
  std::error_code ignored;
  std::filesystem::remove_all(job.folder.checkpoints(job.spec.fence), ignored);
  ASSIGN_OR_RETURN(const int64_t num_bytes, BytesIn(inputs.folders.run));
  return ResultOf(std::move(trained), num_bytes);
}

JobResult Failure(const absl::Status& status) {
  JobResult result;
  result.status = status;
  return result;
}

}  // namespace

absl::StatusOr<TrainingInputs> TrainingInputsOf(const JobFolder& folder, const JobSpec& spec) {
  TrainingInputs inputs;
  for (const JobSpecFile& file : spec.files) {
    ASSIGN_OR_RETURN(const FileKind kind, FileKindFromProto(static_cast<v1::FileKind>(file.kind)));
    inputs.files.push_back({kind, file.name, file.path});
    inputs.sha256.push_back(file.sha256);
  }
  inputs.folders = FoldersOf(folder, spec.fence);
  inputs.tools = ToolsOf(spec);
  return inputs;
}

JobResult RunWorkerJob(const WorkerJob& job) {
  const absl::StatusOr<TrainingSettings> settings = TrainingSettingsFromProto(job.spec.options);
  if (!settings.ok()) return Failure(settings.status());
  JobObserver observer(job, *settings);
  absl::StatusOr<JobResult> result = TrainJob(job, *settings, observer);
  if (result.ok()) return *std::move(result);
  JobResult failure = Failure(result.status());
  // The server checks these files itself before it sets any aside.
  failure.damaged = observer.damaged_files();
  return failure;
}

}  // namespace pepeseg
