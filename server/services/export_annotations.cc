#include "server/services/export_annotations.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/digest.h"
#include "core/base/status_macros.h"
#include "server/api/error.h"
#include "server/services/labelled_views.h"
#include "server/services/segmented_level.h"

namespace pepeseg {
namespace {

constexpr size_t kChunkSize = size_t{1} << 20;
// The message that is being filled, and gRPC's copy of the one that is being sent.
constexpr int64_t kMessages = 2 * static_cast<int64_t>(kChunkSize);
// What a pixel of the mask takes that is being written: itself, the pixels' indices, an image.
constexpr int64_t kBytesPerPixel = 8;
constexpr int64_t kReserveStep = int64_t{16} << 20;

absl::StatusOr<AnnotationFormat> FormatFromProto(v1::AnnotationFormat format) {
  switch (format) {
    case v1::ANNOTATION_FORMAT_UNSPECIFIED:
    case v1::ANNOTATION_FORMAT_COCO:
      return AnnotationFormat::kCoco;
    case v1::ANNOTATION_FORMAT_YOLO:
      return AnnotationFormat::kYolo;
    case v1::ANNOTATION_FORMAT_LABELME:
      return AnnotationFormat::kLabelMe;
    case v1::ANNOTATION_FORMAT_MASKS:
      return AnnotationFormat::kMasks;
    case v1::ANNOTATION_FORMAT_CVAT:
      return AnnotationFormat::kCvat;
    case v1::ANNOTATION_FORMAT_IDS:
      return AnnotationFormat::kIds;
    default:
      return BadField("format", absl::StrCat(static_cast<int>(format)), "no format");
  }
}

}  // namespace

ExportAnnotationsStream::ExportAnnotationsStream(const Dependencies& deps,
                                                 grpc::CallbackServerContext* call,
                                                 const v1::ExportAnnotationsRequest& request)
    : WriteStream(&deps.runner.streams(), &deps.runner.pools().evaluation),
      deps_(deps),
      call_(call),
      origin_(OriginOf(*call)),
      request_(request) {}

absl::Status ExportAnnotationsStream::Open() {
  ASSIGN_OR_RETURN(caller_, deps_.runner.authorizer().Authorize(origin_, request_));
  RETURN_IF_ERROR(Admit(OwnerOf(caller_, origin_)));
  RETURN_IF_ERROR(deps_.runner.quotas().Admit(caller_.project, request_));
  ASSIGN_OR_RETURN(const AnnotationFormat format, FormatFromProto(request_.format()));
  const auto check = [this] {
    return cancelled() ? absl::CancelledError("nobody waits for the annotations")
                       : absl::OkStatus();
  };
  const QueryCall call = {absl::ZeroDuration(), caller_.scenes, check};
  ASSIGN_OR_RETURN(views_, request_.has_segments()
                               ? SegmentedLevel::Begin(deps_.tools, call, request_)
                               : LabelledViews::Begin(deps_.tools, call, request_));
  writer_ = MakeAnnotationWriter(format, views_->scene(), zip_);
  if (request_.table()) table_.emplace(views_->scene());
  return Reserve();
}

absl::Status ExportAnnotationsStream::Reserve() {
  const int64_t need = kMessages + kBytesPerPixel * views_->max_pixels() + zip_.num_bytes() +
                       writer_->num_waiting_bytes();
  while (num_reserved_ < need) {
    const int64_t more = std::max(kReserveStep, need - num_reserved_);
    ASSIGN_OR_RETURN(std::unique_ptr<ReservedMemory> reserved,
                     deps_.models.TakeAnswerMemory(views_->model().id.scene.project, more));
    memory_.push_back(std::move(reserved));
    num_reserved_ += more;
  }
  return absl::OkStatus();
}

absl::StatusOr<bool> ExportAnnotationsStream::FindSome() {
  ASSIGN_OR_RETURN(const bool progressed, views_->FindSome());
  for (const AnnotatedView& view : views_->TakeComplete()) {
    if (cancelled()) return absl::CancelledError("nobody waits for the annotations");
    RETURN_IF_ERROR(writer_->Add(view));
    if (table_) RETURN_IF_ERROR(table_->Add(view));
    RETURN_IF_ERROR(Reserve());
  }
  return progressed;
}

absl::Status ExportAnnotationsStream::Finish() {
  RETURN_IF_ERROR(writer_->Finish());
  if (table_) {
    RETURN_IF_ERROR(zip_.Add("things.csv", table_->Csv(gaussians_), ZipWriter::Method::kDeflated));
  }
  RETURN_IF_ERROR(Reserve());
  ASSIGN_OR_RETURN(file_, std::move(zip_).Finish());
  v1::ExportAnnotationsResponse::Header& header = *message_.mutable_header();
  header.set_model(views_->model().name);
  header.set_num_things(static_cast<int32_t>(views_->scene().things.size()));
  header.set_num_views(static_cast<int32_t>(views_->scene().views.size()));
  header.set_num_bytes(static_cast<int64_t>(file_->size()));
  header.set_sha256(Sha256Hex(*file_));
  // The model may leave the memory while the zip is read.
  writer_.reset();
  table_.reset();
  views_.reset();
  return absl::OkStatus();
}

Stream::Step ExportAnnotationsStream::Continue() {
  Wake();  // again, after what waits for the pool
  return {Next::kIdle, absl::OkStatus()};
}

Stream::Step ExportAnnotationsStream::Work(bool) {
  if (file_) {
    if (num_sent_ == file_->size()) return {Next::kEnd, absl::OkStatus()};
    message_.set_chunk(file_->substr(num_sent_, kChunkSize));
    num_sent_ += message_.chunk().size();
    return {Next::kIo, absl::OkStatus()};
  }
  if (views_ == nullptr) {
    if (absl::Status status = Open(); !status.ok()) return {Next::kEnd, std::move(status)};
    return Continue();
  }
  if (!views_->done()) {
    const absl::StatusOr<bool> progressed = FindSome();
    if (!progressed.ok()) return {Next::kEnd, progressed.status()};
    if (!*progressed) return Continue();
    message_.mutable_progress()->set_num_masks_done(views_->num_masks_done());
    message_.mutable_progress()->set_num_masks(views_->num_masks());
    return {Next::kIo, absl::OkStatus()};
  }
  if (table_ && gaussians_.size() < views_->scene().things.size()) {
    absl::StatusOr<ThingGaussians> found = views_->GaussiansOf(gaussians_.size());
    if (!found.ok()) return {Next::kEnd, found.status()};
    gaussians_.push_back(*found);
    return Continue();
  }
  if (absl::Status status = Finish(); !status.ok()) return {Next::kEnd, std::move(status)};
  return {Next::kIo, absl::OkStatus()};
}

}  // namespace pepeseg
