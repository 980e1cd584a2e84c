#include "server/services/get_photograph.h"

#include <algorithm>
#include <chrono>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/base/status_macros.h"
#include "core/dataset/dataset_files.h"
#include "core/formats/image_header.h"
#include "core/model_files/model_file.h"
#include "server/api/error.h"
#include "server/api/resource_name.h"

namespace pepeseg {
namespace {

constexpr int64_t kPhotographChunkBytes = int64_t{1} << 20;
constexpr int kMaxPhotographSide = 16384;
// How long a thread waits for a damaged file to be checked. Longer checks are awaited by later
// ticks.
constexpr std::chrono::milliseconds kShortCheck{100};

absl::Status CheckPhotographRequest(const v1::GetPhotographRequest& request) {
  const int side = request.max_side();
  if (side < 0 || side > kMaxPhotographSide) {
    return BadField("max_side", absl::StrCat(side),
                    absl::StrCat("must be in [0, ", kMaxPhotographSide, "]"));
  }
  if (request.original() && side != 0) {
    return BadField("max_side", absl::StrCat(side), "an original is not shrunk: leave it out");
  }
  if (request.original() && request.frame() != v1::PIXEL_FRAME_UNSPECIFIED) {
    return BadField("frame", v1::PixelFrame_Name(request.frame()),
                    "an original is not warped: leave it out");
  }
  if (!v1::PixelFrame_IsValid(request.frame())) {
    return BadField("frame", absl::StrCat(request.frame()), "is not a pixel frame");
  }
  return absl::OkStatus();
}

// A dataset, and the folder of the model if the request names a model; else empty.
struct Parent {
  SceneChild dataset;
  std::filesystem::path model;
};

absl::StatusOr<Parent> FindParent(const ModelLoader& models, const NamedScenes& scenes,
                                  const std::string& name) {
  // A model stands for the dataset that it was trained on.
  if (!absl::StrContains(name, "/models/")) {
    ASSIGN_OR_RETURN(const SceneChild dataset, scenes.Child(name, "datasets", "parent"));
    return Parent{dataset, {}};
  }
  ASSIGN_OR_RETURN(const ModelRecord model, models.Find(scenes, name, "parent"));
  return Parent{{model.scene, model.dataset}, models.data_folder() / model.folder};
}

absl::StatusOr<std::vector<DatasetFileRecord>> ListFiles(Store& store, const SceneChild& dataset,
                                                         const std::string& parent) {
  const auto record = store.datasets().GetDataset(dataset.scene, dataset.number);
  if (absl::IsNotFound(record.status())) {
    return WithResource(record.status(), "NO_SUCH_DATASET", parent);
  }
  RETURN_IF_ERROR(record.status());
  if (record->state != DatasetState::kSealed) {
    return WithResource(absl::NotFoundError(absl::StrCat(parent, " is not sealed")),
                        "NO_SUCH_DATASET", parent);
  }
  return store.files().ListDatasetFiles(dataset.scene, dataset.number);
}

absl::StatusOr<DatasetFileRecord> FindPhotograph(const std::vector<DatasetFileRecord>& files,
                                                 const v1::GetPhotographRequest& request) {
  const DatasetFileRecord* found = nullptr;
  std::string why = "the dataset has no such photograph";
  for (const DatasetFileRecord& file : files) {
    if (file.kind == v1::FILE_KIND_VIDEO && IsFrameOf(file.path, request.photograph())) {
      why =
          absl::StrCat("it is a frame of ", file.path, ": only files that were uploaded come back");
    }
    if (file.kind != v1::FILE_KIND_IMAGE) continue;
    const std::string key = PhotoKey(file.path);
    // Without a name, the first photograph in the order of names.
    const bool matches = request.photograph().empty()
                             ? found == nullptr || key < PhotoKey(found->path)
                             : key == request.photograph();
    if (matches) found = &file;
  }
  if (found != nullptr) return *found;
  return WithResource(
      absl::NotFoundError(absl::StrCat("photograph \"", request.photograph(), "\": ", why)),
      "NO_SUCH_PHOTOGRAPH", request.parent());
}

// Returns the model's view of a photograph.
absl::StatusOr<ModelView> FindView(const Parent& parent, const v1::GetPhotographRequest& request,
                                   const std::string& photograph) {
  if (parent.model.empty()) {
    return BadField("frame", v1::PixelFrame_Name(request.frame()),
                    "a dataset has no views: name a model as the parent");
  }
  ASSIGN_OR_RETURN(const std::vector<ModelView> views, ReadModelViews(parent.model));
  for (const ModelView& view : views) {
    if (view.name != photograph) continue;
    if (!view.photograph) {
      return WithResource(absl::FailedPreconditionError(absl::StrCat(
                              request.parent(), " does not know the lenses of its photographs: ",
                              "train the scene again")),
                          "NO_LENS", request.parent());
    }
    return view;
  }
  return BadField("photograph", photograph, "the model has no such view");
}

}  // namespace

absl::Status GetPhotographStream::OpenOriginal(const DatasetFileRecord& file,
                                               const std::filesystem::path& blob) {
  ASSIGN_OR_RETURN(file_, OpenFile::ForReading(blob, file.path));
  std::string start(static_cast<size_t>(std::min<int64_t>(file.size, 16)), '\0');
  if (!file_->ReadAt(0, start)) {
    return absl::DataLossError(absl::StrCat(file.path, ": the stored file cannot be read"));
  }
  sha256_ = file.sha256;
  num_bytes_left_ = file.size;
  v1::GetPhotographResponse::Header& header = *message_.mutable_header();
  if (file.header == HeaderState::kRead) {
    header.set_width(file.width);
    header.set_height(file.height);
  }
  header.set_content_type(ContentTypeOf(start));
  header.set_num_bytes(file.size);
  phase_ = Phase::kSending;
  return absl::OkStatus();
}

absl::Status GetPhotographStream::StartMaking(const PhotographTask& task,
                                              const std::filesystem::path& blob) {
  phase_ = Phase::kMaking;
  // The task holds the stream, which therefore outlives it. It hands its result over under
  // made_mutex_, since a tick may run Work() at the same time.
  const bool taken = deps_.decoders.pool->Submit(
      project_,
      [self = std::static_pointer_cast<GetPhotographStream>(shared_from_this()), task, blob] {
        absl::StatusOr<PhotographPicture> made = MakePicture(
            *self->deps_.decoders.process, task, blob, [&self] { return !self->cancelled(); });
        {
          const std::lock_guard lock(self->made_mutex_);
          self->made_ = std::move(made);
        }
        self->Wake();
      });
  return taken ? absl::OkStatus() : BusyError();
}

absl::Status GetPhotographStream::Open() {
  ASSIGN_OR_RETURN(const AuthorizedCaller caller,
                   deps_.runner.authorizer().Authorize(origin_, request_));
  RETURN_IF_ERROR(Admit(OwnerOf(caller, origin_)));
  RETURN_IF_ERROR(deps_.runner.quotas().Admit(caller.project, request_));
  RETURN_IF_ERROR(CheckPhotographRequest(request_));
  ASSIGN_OR_RETURN(const Parent parent, FindParent(deps_.models, caller.scenes, request_.parent()));
  ASSIGN_OR_RETURN(const auto files,
                   ListFiles(deps_.models.store(), parent.dataset, request_.parent()));
  project_ = parent.dataset.scene.project;
  ASSIGN_OR_RETURN(row_, FindPhotograph(files, request_));
  const DatasetFileRecord& file = row_;
  // Compares the size only; the digest is checked while the file is read.
  if (!deps_.blobs.Has({project_, file.sha256}, file.size)) {
    return absl::DataLossError(
        absl::StrCat(file.path, ": the stored file is missing or has another size"));
  }
  const std::filesystem::path blob = deps_.blobs.Path({project_, file.sha256});
  if (request_.original()) return OpenOriginal(file, blob);
  PhotographTask task;
  task.name = file.path;
  task.sha256 = file.sha256;
  task.form.max_side = request_.max_side();
  task.form.upright = request_.frame() != v1::PIXEL_FRAME_VIEW;
  if (!task.form.upright) {
    ASSIGN_OR_RETURN(task.form.view, FindView(parent, request_, PhotoKey(file.path)));
  }
  return StartMaking(task, blob);
}

absl::StatusOr<bool> GetPhotographStream::TakePicture() {
  const std::lock_guard lock(made_mutex_);
  // A tick, or a wake-up for another reason.
  if (!made_) return false;
  RETURN_IF_ERROR(made_->status());
  PhotographPicture& picture = **made_;
  file_ = std::move(picture.file);
  offset_ = picture.offset;
  num_bytes_left_ = picture.num_bytes;
  v1::GetPhotographResponse::Header& header = *message_.mutable_header();
  header.set_width(picture.width);
  header.set_height(picture.height);
  header.set_content_type("image/jpeg");
  header.set_num_bytes(picture.num_bytes);
  phase_ = Phase::kSending;
  return true;
}

absl::Status GetPhotographStream::FillChunk() {
  const int64_t size = std::min(kPhotographChunkBytes, num_bytes_left_);
  std::string& chunk = *message_.mutable_chunk();
  chunk.resize(static_cast<size_t>(size));
  if (!file_->ReadAt(offset_, chunk)) {
    return absl::DataLossError(absl::StrCat(row_.path, ": cannot be read to its end"));
  }
  offset_ += size;
  num_bytes_left_ -= size;
  // A picture has no digest. The file of an original is checked while it is sent, so the client
  // learns of damage at the end, as DATA_LOSS.
  if (sha256_.empty()) return absl::OkStatus();
  digest_.Add(chunk);
  if (num_bytes_left_ == 0 && digest_.Hex() != sha256_) {
    return absl::DataLossError(absl::StrCat(row_.path, ": the stored file fails its SHA-256"));
  }
  return absl::OkStatus();
}

// The decoder may be at fault, or a client's file: the digest decides whether the file is damaged.
Stream::Step GetPhotographStream::Fail(absl::Status status) {
  const bool may_be_damaged = absl::IsDataLoss(status) && !row_.path.empty();
  if (!may_be_damaged) return {Next::kEnd, std::move(status)};
  phase_ = Phase::kChecking;
  failure_ = std::move(status);
  // Later calls of Fail come from ticks and find the check under way.
  if (!check_.valid()) check_ = deps_.decoders.checker->Check(project_, {row_});
  if (check_.wait_for(kShortCheck) != std::future_status::ready) {
    return {Next::kIdle, absl::OkStatus()};  // until the next tick
  }
  // The stored file has its digest, so the file that was uploaded cannot be decoded, or the decoder
  // failed: uploading it again would not help.
  if (check_.get() == 0) return {Next::kEnd, failure_};
  return {Next::kEnd, absl::DataLossError(absl::StrCat(failure_.message(), "; upload it again"))};
}

Stream::Step GetPhotographStream::Work(bool) {
  absl::Status status;
  if (phase_ == Phase::kNew) {
    status = Open();
    // The decoder's task wakes the stream.
    if (status.ok() && phase_ == Phase::kMaking) return {Next::kIdle, absl::OkStatus()};
  } else if (phase_ == Phase::kMaking) {
    const absl::StatusOr<bool> taken = TakePicture();
    if (taken.ok() && !*taken) return {Next::kIdle, absl::OkStatus()};
    status = taken.status();
  } else if (phase_ == Phase::kChecking) {
    // Fail continues to wait for the check that it began.
    status = failure_;
  } else if (num_bytes_left_ == 0) {
    return {Next::kEnd, absl::OkStatus()};
  } else {
    status = FillChunk();
  }
  if (!status.ok()) return Fail(std::move(status));
  return {Next::kIo, absl::OkStatus()};
}

}  // namespace pepeseg
