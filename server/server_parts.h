#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/jobs/supervisor.h"
#include "server/rpc/service_context.h"
#include "server/server.h"
#include "server/store/store.h"
#include "server/worker_protocol/device.h"

// What a server's options mean for its parts.
namespace pepeseg {

absl::Status CheckOptions(const ServerOptions& options);

// Other servers may use the database and the data directory, too.
bool IsShared(const ServerOptions& options);
absl::StatusOr<std::unique_ptr<Store>> OpenStore(const ServerOptions& options);

void LogDevice(const Device& device, int64_t device_memory);
std::unique_ptr<ModelCache> MakeModelCache(const ServerOptions& options, Backend& backend);

// Host memory that a worker on this machine may take, bytes: of `host_bytes`, which the machine or
// the control group has, what is not the server's. The server's are `model_bytes`, its budget for
// models, and a reserve for its calls. At least a quarter, so that large budgets stop no training.
int64_t WorkerMemory(int64_t host_bytes, int64_t model_bytes);
// The same by the options; 0 where workers run on other machines.
int64_t WorkerMemory(const ServerOptions& options);
// Memory of the device that a training may take, bytes; of the host's no more than a worker may.
int64_t TrainingMemory(const ServerOptions& options, const Backend& backend);

// Without file_path, check_files and on_event; `workers` as the flags say, so that the priors
// command and SAM are still to be found.
SupervisorOptions JobOptions(const ServerOptions& options, const Device& device);
// Of the program, as FindProgram takes it; empty: there is none.
absl::StatusOr<std::filesystem::path> FindPriorsCommand(const std::string& name);
// The folder of SAM that workers get; empty: none. Logs which. FAILED_PRECONDITION, NOT_FOUND: the
// one that is named is not good, see CheckSamFiles.
absl::StatusOr<std::filesystem::path> FindSam(const ServerOptions& options);
int NumCores();

}  // namespace pepeseg
