#include "server/services/selections.h"

#include <filesystem>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/model_files/model_file.h"
#include "server/api/decomposition.h"
#include "server/api/error.h"
#include "server/store/layout.h"

namespace pepeseg {
namespace {

absl::Status WriteMembers(const std::filesystem::path& path, const GaussianSet& set) {
  std::error_code error;
  std::filesystem::create_directories(path.parent_path(), error);
  if (error) {
    return absl::InternalError(
        absl::StrCat("cannot make ", path.parent_path().string(), ": ", error.message()));
  }
  return WriteSelectionFile(path, set);
}

// Adds the detail that a request_id was used before to ALREADY_EXISTS, the store's only error of
// that code here.
absl::Status WithRequest(const absl::Status& status, const SelectionRecord& record) {
  if (!absl::IsAlreadyExists(status)) return status;
  return WithResource(status, "REQUEST_ID_USED", SceneName(record.scene));
}

}  // namespace

absl::StatusOr<SelectionRecord> Selections::FindRecord(const NamedScenes& scenes,
                                                       const std::string& name,
                                                       const std::string& field) const {
  ASSIGN_OR_RETURN(const SceneChild selection, scenes.Child(name, "selections", field));
  return FindRecord(selection);
}

absl::StatusOr<SelectionRecord> Selections::FindRecord(const SceneChild& selection) const {
  auto record = store_.selections().GetSelection(selection.scene, selection.number);
  if (!absl::IsNotFound(record.status())) return record;
  return WithResource(record.status(), "NO_SUCH_SELECTION",
                      ChildName(selection.scene, "selections", selection.number));
}

absl::StatusOr<GaussianSet> Selections::Find(const NamedScenes& scenes, const std::string& name,
                                             const SceneChild& model,
                                             const std::string& field) const {
  ASSIGN_OR_RETURN(const SelectionRecord record, FindRecord(scenes, name, field));
  if (record.scene != model.scene || record.model != model.number) {
    const std::string its_model = ChildName(record.scene, "models", record.model);
    return WithResource(absl::FailedPreconditionError(
                            absl::StrCat(field, ": ", name, " is of ", its_model, ", not of ",
                                         ChildName(model.scene, "models", model.number))),
                        "OTHER_MODEL", its_model);
  }
  return Read(record);
}

absl::StatusOr<GaussianSet> Selections::Read(const SelectionRecord& record) const {
  const std::string name = ChildName(record.scene, "selections", record.number);
  // The record and the file are checked against each other: a file that was restored from another
  // backup could have the bits of another model.
  auto set = ReadSelectionFile(data_folder_ / record.file, name);
  if (set.ok() && static_cast<int64_t>(set->member.size()) != record.model_gaussians) {
    set = absl::DataLossError(absl::StrCat(name, ": has ", set->member.size(), " bits for ",
                                           record.model_gaussians, " Gaussians"));
  }
  if (!set.ok()) return WithResource(set.status(), "CORRUPT_SELECTION", name);
  return set;
}

absl::StatusOr<std::optional<GaussianSet>> Selections::FindSubset(const NamedScenes& scenes,
                                                                  const ResidentModel& model,
                                                                  const v1::Subset& subset,
                                                                  const std::string& field) const {
  GaussianSet found;
  switch (subset.of_case()) {
    case v1::Subset::kSelection: {
      ASSIGN_OR_RETURN(found, Find(scenes, subset.selection(), model.id, field + ".selection"));
      break;
    }
    case v1::Subset::kSegment: {
      RETURN_IF_ERROR(CheckFeatures(model));
      ASSIGN_OR_RETURN(found, FindSegment(*model, subset.segment(), field + ".segment"));
      break;
    }
    default:
      if (!subset.complement()) return std::nullopt;
      return BadField(field + ".complement", "true", "of neither a selection nor a segment");
  }
  if (subset.complement()) {
    for (uint8_t& member : found.member) member = member != 0 ? 0 : 1;
  }
  return found;
}

absl::StatusOr<std::optional<SelectionRecord>> Selections::FindEarlier(
    const SelectionRecord& record) const {
  auto earlier = store_.selections().FindSelectionOfRequest(record.scene, record.request_id,
                                                            record.request_digest);
  if (!earlier.ok()) return WithRequest(earlier.status(), record);
  return earlier;
}

absl::StatusOr<SelectionRecord> Selections::Record(const ResidentModel& model,
                                                   const GaussianSet& set, SelectionRecord record) {
  record.model = model.id.number;
  record.model_gaussians = static_cast<int64_t>(set.member.size());
  record.num_gaussians = set.count();
  const SetBounds bounds = BoundsOf(model->model().gaussians, set);
  for (int axis = 0; axis < 3 && !bounds.empty(); ++axis) {
    record.min[axis] = bounds.min[axis];
    record.max[axis] = bounds.max[axis];
  }
  // The number is taken in a transaction of its own, so that the file has a name that no other call
  // uses. A number whose selection is never recorded is not used again.
  ASSIGN_OR_RETURN(record.number, store_.selections().TakeSelectionNumber(record.scene));
  record.file = (SelectionFolder(record.scene) / std::to_string(record.number)).string();
  const std::filesystem::path path = data_folder_ / record.file;
  RETURN_IF_ERROR(WriteMembers(path, set));
  ASSIGN_OR_RETURN(record.num_bytes, FileSize(path, record.file));
  auto made = store_.selections().CreateSelection(record);
  // A retry that lost against its first request gets that request's record, with another number:
  // then this file has no record either.
  // The file is removed unless the record has been committed. If that is unknown, the file stays
  // and the collector decides later: a commit whose sync failed for lack of space may be there
  // after a restart. The refusal of a quota is RESOURCE_EXHAUSTED, too, but is not private.
  const bool full_disk = absl::IsResourceExhausted(made.status()) && IsPrivate(made.status());
  const bool unknown =
      full_disk || absl::IsUnavailable(made.status()) || absl::IsInternal(made.status());
  if (!unknown && (!made.ok() || made->number != record.number)) {
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
  }
  if (!made.ok()) return WithRequest(made.status(), record);
  return made;
}

absl::Status Selections::Delete(const SelectionRecord& record) {
  RETURN_IF_ERROR(store_.selections().DeleteSelection(record.scene, record.number));
  // The selection is gone already: a file that cannot be removed only costs space.
  std::error_code ignored;
  std::filesystem::remove(data_folder_ / record.file, ignored);
  return absl::OkStatus();
}

}  // namespace pepeseg
