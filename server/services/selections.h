#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "pepeseg/v1/render_service.pb.h"
#include "pepeseg/v1/selection_service.pb.h"
#include "server/api/resource_name.h"
#include "server/services/model_loader.h"
#include "server/store/store.h"

namespace pepeseg {

// The selections of all scenes: each is a record in the store and a file with its Gaussians. Thread
// safe; all calls block. The store must outlive it.
class Selections {
 public:
  Selections(Store& store, std::filesystem::path data_folder)
      : store_(store), data_folder_(std::move(data_folder)) {}

  // Returns the record of a selection that a request names. INVALID_ARGUMENT names `field` if it is
  // not such a name; NOT_FOUND.
  absl::StatusOr<SelectionRecord> FindRecord(const NamedScenes& scenes, const std::string& name,
                                             const std::string& field) const;
  absl::StatusOr<SelectionRecord> FindRecord(const SceneChild& selection) const;

  // Returns the Gaussians of a selection of `model`. In addition to the errors of FindRecord:
  // FAILED_PRECONDITION: the selection is of another model. DATA_LOSS: the file is damaged.
  absl::StatusOr<GaussianSet> Find(const NamedScenes& scenes, const std::string& name,
                                   const SceneChild& model, const std::string& field) const;
  // Returns the Gaussians of a record. DATA_LOSS: the file is damaged.
  absl::StatusOr<GaussianSet> Read(const SelectionRecord& record) const;

  // Returns the Gaussians of a loaded model that `subset` names, or nullopt if it means all of
  // them. Errors are those of Find and FindSegment, below `field`; INVALID_ARGUMENT also for the
  // complement of nothing.
  absl::StatusOr<std::optional<GaussianSet>> FindSubset(const NamedScenes& scenes,
                                                        const ResidentModel& model,
                                                        const v1::Subset& subset,
                                                        const std::string& field) const;

  // Returns the selection that an earlier request with the request_id of `record` has made in its
  // scene. ALREADY_EXISTS: that request was another one.
  absl::StatusOr<std::optional<SelectionRecord>> FindEarlier(const SelectionRecord& record) const;

  // Writes the file, then the record, of a set of Gaussians of the model, and returns the record.
  // Reads scene, base, display_name, request_id and request_digest of `record`. A crash in between
  // leaves a file that the collector removes.
  absl::StatusOr<SelectionRecord> Record(const ResidentModel& model, const GaussianSet& set,
                                         SelectionRecord record);

  // Deletes the record, then the file.
  absl::Status Delete(const SelectionRecord& record);

 private:
  Store& store_;
  const std::filesystem::path data_folder_;
};

}  // namespace pepeseg
