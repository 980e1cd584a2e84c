#include "server/server_parts.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/child_process.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "core/priors/detect/detector.h"
#include "core/priors/sam/sam_borders.h"
#include "kernels/host_memory.h"
#include "pepeseg/v1/dataset_service.grpc.pb.h"
#include "pepeseg/v1/edit_service.grpc.pb.h"
#include "pepeseg/v1/evaluation_service.grpc.pb.h"
#include "pepeseg/v1/job_service.grpc.pb.h"
#include "pepeseg/v1/label_service.grpc.pb.h"
#include "pepeseg/v1/render_service.grpc.pb.h"
#include "pepeseg/v1/segmentation_service.grpc.pb.h"
#include "pepeseg/v1/selection_service.grpc.pb.h"
#include "server/jobs/supervisor.h"
#include "server/listen_rules.h"
#include "server/observe/health_monitor.h"
#include "server/server_metrics.h"
#include "server/store/layout.h"

namespace pepeseg {
namespace {

constexpr absl::string_view kSqlite = "sqlite:";  // before the path in the URL of a database

// Memory that the server keeps for requests, uploads and queries, bytes.
constexpr int64_t kServerReserve = int64_t{1} << 30;

// Returns the budget of models in host memory, bytes.
int64_t HostModelBytes(const ServerOptions& options) {
  return options.model_bytes > 0 ? options.model_bytes : HostMemory().total_bytes / 2;
}

std::string DatabaseUrl(const ServerOptions& options) {
  if (!options.database.empty()) return options.database;
  return "sqlite:" + DatabasePath(options.data).string();
}

// Files that a script of deploy/ installs in a folder, for FindInstalled.
struct Installation {
  const char* what;
  const char* script;
  absl::Status (*check)(const std::filesystem::path& folder);
  const char* used;     // what the log says where it is
  const char* missing;  // and where it is not
};

// Returns the folder: `given`, which must be good, or the first of `defaults` that has one, if it
// is good; empty: none. Logs it.
absl::StatusOr<std::filesystem::path> FindInstalled(
    const Installation& installed, const std::filesystem::path& given,
    const std::vector<std::filesystem::path>& defaults) {
  if (!given.empty()) {
    RETURN_IF_ERROR(installed.check(given));
    spdlog::info("{}, in {}", installed.used, given.string());
    return given;
  }
  for (const std::filesystem::path& folder : defaults) {
    const absl::Status status = installed.check(folder);
    if (absl::IsNotFound(status)) continue;
    if (status.ok()) {
      spdlog::info("{}, found in {}", installed.used, folder.string());
      return folder;
    }
    spdlog::warn("{} is not used: {}", installed.what, std::string(status.message()));
    return std::filesystem::path();
  }
  spdlog::info("{} is not installed ({}): {}", installed.what, installed.script, installed.missing);
  return std::filesystem::path();
}

}  // namespace

bool IsShared(const ServerOptions& options) { return options.database.starts_with("postgresql:"); }

absl::Status CheckOptions(const ServerOptions& options) {
  RETURN_IF_ERROR(CheckListeners(options));
  RETURN_IF_ERROR(CheckAddressesFree(options));
  if (access(options.worker.c_str(), X_OK) != 0) {
    return absl::FailedPreconditionError(
        absl::StrCat("worker: ", options.worker.string(), " is not a program"));
  }
  return absl::OkStatus();
}

void LogDevices(const ServerOptions& options, const std::vector<Device>& devices) {
  for (const Device& device : devices) {
    const std::string because = device.reason.empty() ? "" : ": " + device.reason;
    spdlog::info("computing on {}{}", device.name, because);
    spdlog::info("a training may take {} MiB of its memory",
                 TrainingMemory(options, *device.backend, devices.size()) >> 20);
  }
}

absl::StatusOr<std::filesystem::path> FindCommand(const std::string& what,
                                                  const std::string& name) {
  if (name.empty()) return std::filesystem::path();
  const absl::StatusOr<std::filesystem::path> found = FindProgram(name);
  if (found.ok()) return std::filesystem::absolute(*found);
  return absl::FailedPreconditionError(
      absl::StrCat(what, ": ", found.status().message(), ", or cannot be run"));
}

absl::StatusOr<std::filesystem::path> FindSam(const ServerOptions& options) {
  return FindInstalled({"SAM", "deploy/sam.sh", CheckSamFiles, "masks are made by SAM",
                        "masks are made by the built-in method"},
                       options.workers.sam, options.default_sam);
}

absl::StatusOr<std::filesystem::path> FindDetector(const ServerOptions& options) {
  return FindInstalled({"the detector of words", "deploy/detector.sh", CheckDetectorFiles,
                        "everyday words are found by the detector",
                        "words are found in names and descriptions of labels"},
                       options.detector, options.default_detector);
}

absl::StatusOr<TextTask> FindTextCommand(const ServerOptions& options, size_t num_devices) {
  TextTask task;
  ASSIGN_OR_RETURN(const std::filesystem::path program,
                   FindCommand("text command", options.text_command));
  task.program = program.string();
  task.time_limit = absl::Seconds(options.text_seconds);
  task.sandbox_reads = options.workers.sandbox_reads;
  task.pass_environment = options.workers.pass_environment;
  task.memory_limit = WorkerMemory(options, num_devices);
  task.num_threads = options.num_threads;
  task.sandbox = options.workers.sandbox;
  return task;
}

absl::StatusOr<std::shared_ptr<const WordNet>> FindWordNet(const ServerOptions& options) {
  if (options.wordnet.empty()) return std::shared_ptr<const WordNet>();
  auto wordnet = WordNet::Open(options.wordnet);
  if (absl::IsNotFound(wordnet.status()) && options.wordnet == kDefaultWordNet) {
    spdlog::info("WordNet is not installed (wordnet-base): labels are found without synonyms");
    return std::shared_ptr<const WordNet>();
  }
  RETURN_IF_ERROR(wordnet.status());
  spdlog::info("labels are found by WordNet's synonyms, too, in {}", options.wordnet.string());
  return *std::move(wordnet);
}

int NumCores() { return static_cast<int>(std::max(1u, std::thread::hardware_concurrency())); }

absl::StatusOr<std::optional<LockedFile>> LockDatabase(const ServerOptions& options) {
  const std::string url = DatabaseUrl(options);
  if (!absl::StartsWith(url, kSqlite)) return std::nullopt;
  // The real path: a link to the file, or to a folder above it, names the same database.
  std::error_code error;
  std::filesystem::path path = std::filesystem::weakly_canonical(url.substr(kSqlite.size()), error);
  if (error) return FileError(url, "cannot resolve", error.value());
  path += ".lock";
  absl::StatusOr<LockedFile> lock = LockedFile::TryAlone(path);
  if (absl::IsAborted(lock.status())) {
    return absl::FailedPreconditionError(absl::StrCat(url, ": another server uses this database"));
  }
  RETURN_IF_ERROR(lock.status());
  return std::optional<LockedFile>(*std::move(lock));
}

absl::StatusOr<std::unique_ptr<Store>> OpenStore(const ServerOptions& options) {
  const std::string url = DatabaseUrl(options);
  // A SQLite database has one server, which holds all jobs without a lease.
  if (!IsShared(options)) {
    auto store = Store::Open(url);
    if (store.ok() || !absl::StartsWith(url, kSqlite)) return store;
    // The operator may not know where the data is: by default in a folder of the home directory.
    return absl::Status(store.status().code(),
                        absl::StrCat(url.substr(kSqlite.size()), ": ", store.status().message()));
  }
  return Store::Open(url, {HolderName(), absl::Seconds(options.launch.lease_seconds)});
}

SupervisorOptions JobOptions(const ServerOptions& options, const std::vector<Device>& devices) {
  SupervisorOptions job_options;
  job_options.data_folder = options.data;
  job_options.worker = options.worker;
  job_options.workers = options.workers;
  const int num_threads = ThreadsOfDevice(options.num_threads, static_cast<int>(devices.size()));
  job_options.devices.clear();
  for (const Device& device : devices) {
    const std::string& of_nodes = options.launch.slurm_device;
    job_options.devices.push_back(
        {of_nodes.empty() ? device.id : of_nodes, device.name, num_threads});
  }
  job_options.memory_limit = WorkerMemory(options, devices.size());
  job_options.launch = options.launch;
  job_options.launch.database = DatabaseUrl(options);
  return job_options;
}

int64_t WorkerMemory(int64_t host_bytes, int64_t model_bytes) {
  const int64_t reserve = std::min(kServerReserve, host_bytes / 8);
  return std::max(host_bytes / 4, host_bytes - model_bytes - reserve);
}

int64_t WorkerMemory(const ServerOptions& options, size_t num_devices) {
  if (options.launch.launcher != LaunchOptions::Launcher::kProcess) return 0;
  return WorkerMemory(HostMemory().total_bytes, HostModelBytes(options)) /
         static_cast<int64_t>(num_devices);
}

int64_t TrainingMemory(const ServerOptions& options, const Backend& backend, size_t num_devices) {
  const DeviceMemory memory = backend.memory();
  const int64_t bytes = options.device_memory > 0 ? options.device_memory : memory.free_bytes;
  const int64_t worker = WorkerMemory(options, num_devices);
  return memory.is_host && worker > 0 ? std::min(bytes, worker) : bytes;
}

TrainingDevice SmallestDevice(const ServerOptions& options, const std::vector<Device>& devices) {
  const Device* smallest = nullptr;
  int64_t least = 0;
  for (const Device& device : devices) {
    const int64_t bytes = TrainingMemory(options, *device.backend, devices.size());
    if (smallest == nullptr || bytes < least) {
      smallest = &device;
      least = bytes;
    }
  }
  return {*smallest->backend, least};
}

std::vector<ModelDevice> MakeModelDevices(const ServerOptions& options,
                                          const std::vector<Device>& devices) {
  std::vector<ModelDevice> made;
  for (const Device& device : devices) {
    Backend& backend = *device.backend;
    const DeviceMemory memory = backend.memory();
    MemoryBytes limit = {HostModelBytes(options) / static_cast<int64_t>(devices.size()),
                         options.model_device_bytes};
    if (limit.device <= 0) limit.device = memory.total_bytes / 2;
    made.push_back({device.id, device.name, backend,
                    std::make_unique<ModelCache>(MemoryBudget(limit, memory.is_host),
                                                 [&backend] { backend.ReleaseFreed(); })});
  }
  return made;
}

std::unique_ptr<HealthMonitor> MakeHealthMonitor(Store& store, const std::vector<Device>& devices,
                                                 const std::filesystem::path& data_folder) {
  std::vector<std::string> services = ServiceNames();
  services.emplace_back("");
  std::vector<HealthMonitor::Probe> probes;
  probes.push_back({"database", [&store] { return store.Ping(); }, services});
  probes.push_back(
      {"data directory",
       [folder = data_folder] { return ProbeDisk(folder, kMinDiskFreeBytes); },
       {v1::DatasetService::service_full_name(), v1::JobService::service_full_name()}});
  for (const Device& device : devices) {
    probes.push_back(
        {"device " + device.id,
         [backend = device.backend.get()] { return ProbeDevice(*backend); },
         {v1::SegmentationService::service_full_name(), v1::LabelService::service_full_name(),
          v1::SelectionService::service_full_name(), v1::EditService::service_full_name(),
          v1::RenderService::service_full_name(), v1::EvaluationService::service_full_name(), ""},
         /*blocks=*/false});
  }
  return std::make_unique<HealthMonitor>(std::move(services), std::move(probes));
}

}  // namespace pepeseg
