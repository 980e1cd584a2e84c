#include "server/services/stored_files.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/api/error.h"
#include "server/api/resource_name.h"

namespace pepeseg {

absl::Status CheckFilesStored(const ServiceContext& context, const std::string& scene,
                              int64_t dataset) {
  Store& store = *context.store;
  ASSIGN_OR_RETURN(const std::vector<DatasetFileRow> files,
                   store.files().ListDatasetFiles(scene, dataset));
  ASSIGN_OR_RETURN(const std::string project, store.scenes().ProjectOfScene(scene));
  std::vector<std::string> healed, gone;
  const DatasetFileRow* first = nullptr;
  int num_missing = 0;
  for (const DatasetFileRow& file : files) {
    const bool there = context.blobs->Has({project, file.sha256}, file.size);
    if (there && !file.stored) healed.push_back(file.sha256);
    if (there) continue;
    if (file.stored) gone.push_back(file.sha256);
    if (++num_missing == 1) first = &file;
  }
  RETURN_IF_ERROR(store.files().SetDigestsStored(project, healed, /*stored=*/true));
  RETURN_IF_ERROR(store.files().SetDigestsStored(project, gone, /*stored=*/false));
  if (num_missing == 0) return absl::OkStatus();
  return WithResource(
      absl::FailedPreconditionError(absl::StrCat(
          ChildName(scene, "datasets", dataset), ": the stored bytes of ", num_missing, " of ",
          files.size(), " files are damaged or gone, the first is '", first->path,
          "'; upload the same files again, then train this dataset or the new one")),
      "FILES_MISSING", first->path);
}

}  // namespace pepeseg
