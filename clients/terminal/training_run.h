#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "clients/cpp/client.h"
#include "clients/cpp/dataset_folder.h"
#include "pepeseg/v1/dataset_service.pb.h"
#include "pepeseg/v1/job_service.pb.h"

// A training from a folder to a model: upload, start, and progress on standard error.
namespace pepeseg::client::cli {

// Adds --depth-kind, "depth" or "disparity": the kind of the files in depth/.
void AddDepthKindFlag(CLI::App& verb, std::string& depth_kind);
// Converts a value of --depth-kind.
v1::FileKind DepthKind(const std::string& depth_kind);

// Uploads the folder as Client::Upload does, with progress on standard error.
absl::StatusOr<v1::Dataset> UploadFolder(const Client& client, const std::string& scene,
                                         const DatasetFolder& folder);

// Queues a training and returns its job. `settings` are NAME=VALUE, see SetOption.
absl::StatusOr<v1::Job> StartTraining(const Client& client, const std::string& scene,
                                      const std::string& dataset,
                                      const std::vector<std::string>& settings);

// Called once for each event of a watched job except heartbeats.
using EventFn = absl::FunctionRef<void(const v1::JobEvent&)>;

// Follows a job to its end, with progress on standard error, and returns the job if it succeeded.
// Resumes after a lost connection as Client::WatchJob does, without missing an event. A job that
// failed or was cancelled is an error of JobFailed or JobCancelled.
// previews: folder that gets each preview of the job as a JPEG, also those from before the watch,
// so that all events are replayed; created if it is missing. Empty: none. LocalFileError: a file
// there cannot be written.
absl::StatusOr<v1::Job> WatchJob(const Client& client, const std::string& job, EventFn on_event,
                                 const std::string& previews = "");

// Adds --previews, the folder of WatchJob.
void AddPreviewsFlag(CLI::App& verb, std::string& previews);

}  // namespace pepeseg::client::cli
