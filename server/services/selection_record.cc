#include "server/services/selection_record.h"

#include <filesystem>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/base/file_bytes.h"
#include "core/base/private_error.h"
#include "core/base/status_macros.h"
#include "core/model_files/selection_file.h"
#include "core/select/gaussian_sets.h"
#include "server/api/error.h"
#include "server/api/resource_name.h"
#include "server/api/rows_to_proto.h"
#include "server/store/layout.h"

namespace pepeseg {
namespace {

template <typename Request>
void SetFrom(Request& request, SelectionRow* row) {
  row->request_id = request.request_id();
  request.clear_request_id();
  // With the type: requests of two kinds may have the same bytes.
  row->request_digest = Sha256Hex(request.GetTypeName() + "\n" + request.SerializeAsString());
}

absl::Status WriteMembers(const std::filesystem::path& path, const GaussianSet& set) {
  std::error_code error;
  std::filesystem::create_directories(path.parent_path(), error);
  if (error) {
    return absl::InternalError(
        absl::StrCat("cannot make ", path.parent_path().string(), ": ", error.message()));
  }
  return WriteSelectionFile(path, set);
}

absl::Status WithRequest(const absl::Status& status, const SelectionRow& row) {
  if (!absl::IsAlreadyExists(status)) return status;
  return WithResource(status, "REQUEST_ID_USED", SceneName(row.scene));
}

}  // namespace

v1::Selection ToProto(const SelectionRow& row) {
  v1::Selection proto;
  proto.set_name(ChildName(row.scene, "selections", row.number));
  proto.set_model(ChildName(row.scene, "models", row.model));
  proto.set_num_gaussians(row.num_gaussians);
  if (row.num_gaussians > 0) {
    proto.mutable_min()->Assign(row.min.begin(), row.min.end());
    proto.mutable_max()->Assign(row.max.begin(), row.max.end());
  }
  if (row.base != 0) proto.set_base(ChildName(row.scene, "selections", row.base));
  *proto.mutable_create_time() = ToProto(row.create_time);
  return proto;
}

void SetRequest(v1::SelectRequest request, SelectionRow* row) { SetFrom(request, row); }

void SetRequest(v1::CombineSelectionsRequest request, SelectionRow* row) { SetFrom(request, row); }

absl::StatusOr<std::optional<SelectionRow>> FindEarlier(const ServiceContext& context,
                                                        const SelectionRow& row) {
  auto earlier = context.store->selections().FindSelectionOfRequest(row.scene, row.request_id,
                                                                    row.request_digest);
  if (!earlier.ok()) return WithRequest(earlier.status(), row);
  return earlier;
}

absl::StatusOr<SelectionRow> RecordSelection(const ServiceContext& context,
                                             const ResidentModel& model, const GaussianSet& set,
                                             SelectionRow row) {
  row.model = model.row.number;
  row.model_gaussians = static_cast<int64_t>(set.member.size());
  row.num_gaussians = set.count();
  const SetBounds bounds = BoundsOf(model.segmenter->model().gaussians, set);
  for (int axis = 0; axis < 3 && !bounds.empty(); ++axis) {
    row.min[axis] = bounds.min[axis];
    row.max[axis] = bounds.max[axis];
  }
  ASSIGN_OR_RETURN(row.number, context.store->selections().TakeSelectionNumber(row.scene));
  row.file = (SelectionFolder(row.scene) / std::to_string(row.number)).string();
  const std::filesystem::path path = context.data_folder / row.file;
  RETURN_IF_ERROR(WriteMembers(path, set));
  ASSIGN_OR_RETURN(row.num_bytes, FileSize(path, row.file));
  auto made = context.store->selections().CreateSelection(row);
  // Where nobody knows whether the row was committed, the collector finds out: a commit whose sync
  // failed for lack of space may be there after a restart. A quota's refusal is not private.
  const bool full_disk = absl::IsResourceExhausted(made.status()) && IsPrivate(made.status());
  const bool unknown =
      full_disk || absl::IsUnavailable(made.status()) || absl::IsInternal(made.status());
  if (!unknown && (!made.ok() || made->number != row.number)) {
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
  }
  if (!made.ok()) return WithRequest(made.status(), row);
  return made;
}

}  // namespace pepeseg
