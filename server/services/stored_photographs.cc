#include "server/services/stored_photographs.h"

#include <cstdint>
#include <utility>

#include "core/base/status_macros.h"
#include "core/dataset/photo_file.h"
#include "pepeseg/v1/dataset_service.pb.h"

namespace pepeseg {
namespace {

// Larger files are not searched for an EXIF orientation, so that they do not fill the memory.
constexpr int64_t kMostPhotographBytes = int64_t{64} << 20;

}  // namespace

absl::StatusOr<Image> MakeImage(const PhotographProcess& process, const PhotographTask& task,
                                const std::filesystem::path& blob,
                                absl::FunctionRef<bool()> wanted) {
  ASSIGN_OR_RETURN(const PhotographPicture picture, MakePicture(process, task, blob, wanted));
  std::string bytes(static_cast<size_t>(picture.num_bytes), '\0');
  const int64_t num_expected = int64_t{3} * picture.width * picture.height;
  if (picture.num_bytes != num_expected || !picture.file.ReadAt(picture.offset, bytes)) {
    return absl::InternalError("the decoder's answer does not have the size of its picture");
  }
  return Image{picture.width, picture.height, 3, {bytes.begin(), bytes.end()}};
}

absl::Status StoredPhotographs::List() {
  if (files_) return absl::OkStatus();
  // The record of the model may be older than a change of its dataset's.
  ASSIGN_OR_RETURN(const ModelRecord record, store_.models().GetModel(model_.scene, model_.number));
  ASSIGN_OR_RETURN(const std::vector<DatasetFileRecord> files,
                   store_.files().ListDatasetFiles(record.scene, record.dataset));
  project_ = record.scene.project;
  files_.emplace();
  for (const DatasetFileRecord& file : files) {
    if (file.kind == v1::FILE_KIND_IMAGE) files_->emplace(PhotoKey(file.path), file);
  }
  return absl::OkStatus();
}

absl::StatusOr<DatasetFileRecord> StoredPhotographs::Find(const ModelView& view) {
  RETURN_IF_ERROR(List());
  const auto found = files_->find(view.name);
  if (found != files_->end()) return found->second;
  return absl::NotFoundError("the dataset has no such photograph");
}

int StoredPhotographs::Orientation(const ModelView& view) {
  if (!view.photograph) return 1;
  if (view.photograph->orientation != 1) return view.photograph->orientation;
  // The import may have turned the photograph, and does not record what its file says.
  const auto file = Find(view);
  if (!file.ok() || file->size > kMostPhotographBytes) return 1;
  const auto facts = ReadPhotoFacts({FileKind::kImage, file->path, PathOf(*file)});
  return facts.ok() ? facts->orientation : 1;
}

absl::StatusOr<Image> StoredPhotographs::Formed(const ModelView& view, const PhotographForm& form) {
  ASSIGN_OR_RETURN(const DatasetFileRecord file, Find(view));
  PhotographTask task;
  task.name = file.path;
  task.sha256 = file.sha256;
  task.form = form;
  task.raw = true;
  return MakeImage(process_, task, PathOf(file), wanted_);
}

}  // namespace pepeseg
