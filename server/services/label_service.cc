#include "server/services/label_service.h"

#include <algorithm>
#include <memory>
#include <string>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/formats/rle.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/api/records_to_proto.h"
#include "server/api/request_image.h"
#include "server/api/resource_name.h"
#include "server/api/segment_request.h"
#include "server/services/export_annotations.h"

namespace pepeseg {
namespace {

constexpr size_t kMaxTextBytes = 256;

v1::Label WithoutMask(const LabelRecord& record) {
  v1::Label proto;
  proto.set_name(LabelName(record.scene, record.id));
  proto.set_text(record.text);
  proto.set_view(record.view);
  proto.set_area(record.area);
  *proto.mutable_create_time() = ToProto(record.create_time);
  return proto;
}

// Returns the mask of a label as it is stored, in the pixels of the view.
v1::CocoRle StoredRle(const LabelRecord& record) {
  v1::CocoRle rle;
  rle.set_width(record.width);
  rle.set_height(record.height);
  rle.set_counts(record.counts);
  return rle;
}

absl::Status CheckCreate(const v1::CreateLabelRequest& request) {
  RETURN_IF_ERROR(CheckId(request.label_id(), "label_id"));
  const size_t size = request.label().text().size();
  if (size > kMaxTextBytes) {
    return BadField("label.text", absl::StrCat(size),
                    absl::StrCat("bytes; allowed are ", kMaxTextBytes));
  }
  return CheckRequestId(request.request_id());
}

// A label as the client gave it and as it is stored.
struct GivenLabel {
  LabelRecord record;  // with the mask in the view
  v1::CocoRle mask;    // in the frame of the request
};

// Reads a label; its view and mask are checked against the live model.
absl::StatusOr<GivenLabel> ReadLabel(ModelLoader& models, const UnaryCall& call,
                                     const v1::CreateLabelRequest& request) {
  GivenLabel given;
  LabelRecord& record = given.record;
  ASSIGN_OR_RETURN(record.scene, call.scenes().Scene(request.parent(), "parent"));
  RETURN_IF_ERROR(CheckCreate(request));
  RETURN_IF_ERROR(CheckFrame(request.frame()));
  const v1::Label& label = request.label();
  ASSIGN_OR_RETURN(const ResidentModel model, models.Load({record.scene, kLiveModel}));
  ASSIGN_OR_RETURN(const ModelView view, FindView(label.view(), model->model(), "label.view"));
  const Frame frame(view, FrameKindFromProto(request.frame()));
  ASSIGN_OR_RETURN(BinaryMask mask, ReadMask(label.mask(), frame, "label.mask"));
  given.mask = RleToProto(mask, frame.width(), frame.height());
  // In the pixels of the client's frame.
  record.area = std::count(mask.pixels.begin(), mask.pixels.end(), 1);
  // Stored in the pixels of the view, which prompts use; the frame of later requests may be another
  // one.
  ASSIGN_OR_RETURN(Prompt in_view, ToViewAt(frame, {view, std::move(mask)}, "label.mask"));
  record.id = request.label_id();
  record.text = label.text().empty() ? record.id : label.text();
  record.view = view.name;
  record.width = view.camera.width;
  record.height = view.camera.height;
  record.counts = EncodeCocoRle(std::get<BinaryMask>(in_view.what), record.width, record.height);
  record.request_id = request.request_id();
  return given;
}

}  // namespace

LabelServiceRpc::LabelServiceRpc(const CallRunner& runner, ModelLoader& models,
                                 JobSnapshots& snapshots, ViewImages& images)
    : runner_(runner), models_(models), snapshots_(snapshots), images_(images) {}

// Loads the live model if it is not in memory.
absl::Status LabelServiceRpc::CreateLabel(const UnaryCall& call,
                                          const v1::CreateLabelRequest& request,
                                          v1::Label* response) const {
  ASSIGN_OR_RETURN(const GivenLabel given, ReadLabel(models_, call, request));
  const LabelRecord& label = given.record;
  const auto made = models_.store().labels().CreateLabel(label);
  if (absl::IsAlreadyExists(made.status())) {
    return WithResource(made.status(), "LABEL_EXISTS", LabelName(label.scene, label.id));
  }
  RETURN_IF_ERROR(made.status());
  *response = WithoutMask(*made);
  // A retry with the same mask gets it in the frame of the request, as the first request did.
  v1::CocoRle& mask = *response->mutable_mask()->mutable_rle();
  mask = made->counts == label.counts ? given.mask : StoredRle(*made);
  return absl::OkStatus();
}

// Returns the mask as the view of the live model shows it, in the frame of the request. Loads the
// model, too.
absl::Status LabelServiceRpc::GetLabel(const UnaryCall& call, const v1::GetLabelRequest& request,
                                       v1::Label* response) const {
  ASSIGN_OR_RETURN(const SceneLabel label, call.scenes().Label(request.name(), "name"));
  RETURN_IF_ERROR(CheckFrame(request.frame()));
  const auto record = models_.store().labels().GetLabel(label.scene, label.id);
  if (absl::IsNotFound(record.status())) {
    return WithResource(record.status(), "NO_SUCH_LABEL", request.name());
  }
  RETURN_IF_ERROR(record.status());
  ASSIGN_OR_RETURN(const ResidentModel model, models_.Load({label.scene, kLiveModel}));
  ASSIGN_OR_RETURN(const Prompt prompt, PromptOfLabel(*record, model->model(), model.id));
  const Frame frame(prompt.view, FrameKindFromProto(request.frame()));
  *response = WithoutMask(*record);
  *response->mutable_mask()->mutable_rle() =
      RleToProto(frame.FromView(std::get<BinaryMask>(prompt.what)), frame.width(), frame.height());
  return absl::OkStatus();
}

absl::Status LabelServiceRpc::ListLabels(const UnaryCall& call,
                                         const v1::ListLabelsRequest& request,
                                         v1::ListLabelsResponse* response) const {
  ASSIGN_OR_RETURN(const SceneRef scene, call.scenes().Scene(request.parent(), "parent"));
  ASSIGN_OR_RETURN(const PageRequest page,
                   PageFromProto(request.page_size(), request.page_token()));
  ASSIGN_OR_RETURN(const Page<LabelRecord> labels,
                   models_.store().labels().ListLabels(scene, page));
  for (const LabelRecord& record : labels.records) *response->add_labels() = WithoutMask(record);
  response->set_next_page_token(labels.next_page_token);
  return absl::OkStatus();
}

absl::Status LabelServiceRpc::DeleteLabel(const UnaryCall& call,
                                          const v1::DeleteLabelRequest& request,
                                          google::protobuf::Empty* /*response*/) const {
  ASSIGN_OR_RETURN(const SceneLabel label, call.scenes().Label(request.name(), "name"));
  absl::Status deleted = models_.store().labels().DeleteLabel(label.scene, label.id);
  if (absl::IsNotFound(deleted)) return WithResource(deleted, "NO_SUCH_LABEL", request.name());
  return deleted;
}

grpc::ServerWriteReactor<v1::ExportAnnotationsResponse>* LabelServiceRpc::ExportAnnotations(
    grpc::CallbackServerContext* call, const v1::ExportAnnotationsRequest* request) {
  const auto stream = std::make_shared<ExportAnnotationsStream>(
      ExportAnnotationsStream::Dependencies{
          runner_, models_, {snapshots_, models_.store(), images_}},
      call, *request);
  stream->Begin();
  return stream.get();  // owns itself until OnDone
}

}  // namespace pepeseg
