#include "server/services/selection_lookup.h"

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/model_files/selection_file.h"
#include "server/api/error.h"
#include "server/api/resource_name.h"

namespace pepeseg {

absl::StatusOr<SelectionRow> FindSelectionRow(const ServiceContext& context,
                                              const std::string& name, const std::string& field) {
  ASSIGN_OR_RETURN(const SceneChild selection, ParseChildName(name, "selections", field));
  auto row = context.store->selections().GetSelection(selection.scene, selection.number);
  if (absl::IsNotFound(row.status())) return WithResource(row.status(), "NO_SUCH_SELECTION", name);
  return row;
}

absl::StatusOr<GaussianSet> FindSelection(const ServiceContext& context, const std::string& name,
                                          const SceneChild& model, const std::string& field) {
  ASSIGN_OR_RETURN(const SelectionRow row, FindSelectionRow(context, name, field));
  if (row.scene != model.scene || row.model != model.number) {
    const std::string its_model = ChildName(row.scene, "models", row.model);
    return WithResource(absl::FailedPreconditionError(
                            absl::StrCat(field, ": ", name, " is of ", its_model, ", not of ",
                                         ChildName(model.scene, "models", model.number))),
                        "OTHER_MODEL", its_model);
  }
  auto set = ReadSelectionFile(context.data_folder / row.file, name);
  if (set.ok() && static_cast<int64_t>(set->member.size()) != row.model_gaussians) {
    set = absl::DataLossError(absl::StrCat(name, ": has ", set->member.size(), " bits for ",
                                           row.model_gaussians, " Gaussians"));
  }
  if (!set.ok()) return WithResource(set.status(), "CORRUPT_SELECTION", name);
  return set;
}

}  // namespace pepeseg
