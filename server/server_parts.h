#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/find/wordnet.h"
#include "server/data/locked_file.h"
#include "server/jobs/supervisor.h"
#include "server/observe/health_monitor.h"
#include "server/server_options.h"
#include "server/services/model_loader.h"
#include "server/store/store.h"
#include "server/worker_protocol/device.h"
#include "server/worker_protocol/text_task.h"

// Makes the parts of a server from its options.
namespace pepeseg {

// Checks what can be checked before anything is opened: listeners, their addresses, the worker
// program. FAILED_PRECONDITION, UNAVAILABLE: see listen_rules.h. FAILED_PRECONDITION:
// options.worker is not a program.
absl::Status CheckOptions(const ServerOptions& options);

// Returns whether other servers may use the database and the data directory at the same time.
bool IsShared(const ServerOptions& options);
// Locks a SQLite database, wherever it is, for this server. Returns nothing for PostgreSQL, which
// servers share. FAILED_PRECONDITION: another server uses it.
absl::StatusOr<std::optional<LockedFile>> LockDatabase(const ServerOptions& options);
// Opens the database. Errors as Store::Open.
absl::StatusOr<std::unique_ptr<Store>> OpenStore(const ServerOptions& options);

// Logs the devices, and how much of the memory of each a training may take.
void LogDevices(const ServerOptions& options, const std::vector<Device>& devices);
// Makes an empty cache of models for each device, with the budgets of the options: each device has
// an equal part of the host's. `devices` must outlive them.
std::vector<ModelDevice> MakeModelDevices(const ServerOptions& options,
                                          const std::vector<Device>& devices);
// Makes the health of a server: all services need the database; DatasetService and JobService also
// need free disk space; the services of queries also need every device. The server as a whole, "",
// needs the database and the devices, so that a full disk does not stop queries.
std::unique_ptr<HealthMonitor> MakeHealthMonitor(Store& store, const std::vector<Device>& devices,
                                                 const std::filesystem::path& data_folder);

// Returns the host memory, in bytes, that a worker on this machine may take: `host_bytes`, the
// memory of the machine or control group, less `model_bytes`, the server's budget for models, and
// less a reserve for its requests. At least a quarter of `host_bytes`, so that a large budget stops
// no training.
int64_t WorkerMemory(int64_t host_bytes, int64_t model_bytes);
// Returns the same for the options, divided by the number of devices, since each may have a worker;
// 0 where workers run on other machines.
int64_t WorkerMemory(const ServerOptions& options, size_t num_devices);
// Returns the memory, in bytes, that a training may take of one of `num_devices` devices. On a
// device whose memory is the host's, at most WorkerMemory().
int64_t TrainingMemory(const ServerOptions& options, const Backend& backend, size_t num_devices);

// The device of which a training may take the least memory. A job may start on any device, so this
// one decides what fits.
struct TrainingDevice {
  Backend& backend;
  int64_t memory_bytes;
};
TrainingDevice SmallestDevice(const ServerOptions& options, const std::vector<Device>& devices);

// Returns the supervisor's options, without file_path, check_files and on_event. `workers` is as
// the flags say: the caller replaces priors_command and sam by what FindCommand and FindSam return.
SupervisorOptions JobOptions(const ServerOptions& options, const std::vector<Device>& devices);
// Returns the path of the operator's program `what`, such as "priors command", which FindProgram
// looks up; empty if `name` is. FAILED_PRECONDITION: there is no such program.
absl::StatusOr<std::filesystem::path> FindCommand(const std::string& what, const std::string& name);
// Returns the folder of SAM for workers and logs it; empty: none. FAILED_PRECONDITION, NOT_FOUND:
// the folder that the options name is not good, see CheckSamFiles.
absl::StatusOr<std::filesystem::path> FindSam(const ServerOptions& options);
// Returns the folder of the detector of words and logs it; empty: none. Errors as FindSam, see
// CheckDetectorFiles.
absl::StatusOr<std::filesystem::path> FindDetector(const ServerOptions& options);
// Returns what the text command runs with for all texts; without a program if the options name
// none. Errors are those of FindCommand.
absl::StatusOr<TextTask> FindTextCommand(const ServerOptions& options, size_t num_devices);
// Returns WordNet and logs it; null: none. NOT_FOUND and other errors: the folder that the options
// name is not good, see WordNet::Open.
absl::StatusOr<std::shared_ptr<const WordNet>> FindWordNet(const ServerOptions& options);
// Returns the number of CPU cores, at least 1.
int NumCores();

}  // namespace pepeseg
