#include "server/services/model_versions.h"

#include <string>
#include <system_error>

#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "server/store/layout.h"
#include "server/worker_protocol/job_folder.h"

namespace pepeseg {

absl::StatusOr<ModelRecord> StoreVersion(ModelLoader& models, const ModelRecord& from,
                                         ModelRecord made, WriteVersion write) {
  made.made_from = from.number;
  // The number is taken in a transaction of its own, so that the folder has a name that no other
  // call uses. A number whose model is never recorded is not used again.
  ASSIGN_OR_RETURN(made.number, models.store().models().TakeModelNumber(from.scene));
  made.folder = (ModelVersionFolder(from.scene) / std::to_string(made.number)).string();
  const std::filesystem::path& data = models.data_folder();
  RETURN_IF_ERROR(CheckModelFolder(data, from.folder));
  const auto num_bytes = write(data / from.folder, data / made.folder);
  if (!num_bytes.ok()) {
    // The model and its files may have been deleted meanwhile.
    RETURN_IF_ERROR(models.store().models().GetModel(from.scene, from.number).status());
    return num_bytes.status();
  }
  made.num_bytes = *num_bytes;
  auto stored = models.store().models().CreateVersion(made);
  // The folder stays if it is not known whether the record was committed; the collector decides
  // later. See Selections::Record.
  const bool full_disk = absl::IsResourceExhausted(stored.status()) && IsPrivate(stored.status());
  const bool unknown =
      full_disk || absl::IsUnavailable(stored.status()) || absl::IsInternal(stored.status());
  if (!stored.ok() && !unknown) {
    std::error_code ignored;
    std::filesystem::remove_all(data / made.folder, ignored);
  }
  return stored;
}

}  // namespace pepeseg
