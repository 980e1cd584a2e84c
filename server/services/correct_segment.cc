#include "server/services/correct_segment.h"

#include <spdlog/spdlog.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "core/correct/correct_field.h"
#include "core/model_files/model_version.h"
#include "server/api/convert.h"
#include "server/api/error.h"
#include "server/api/request_image.h"
#include "server/api/segment_request.h"
#include "server/services/model_versions.h"

namespace pepeseg {
namespace {

// A correction takes seconds. One that takes this long has a device or a disk that hardly works.
constexpr absl::Duration kTimeLimit = absl::Seconds(60);

absl::Status CheckRequest(const v1::CorrectSegmentRequest& request) {
  RETURN_IF_ERROR(CheckFrame(request.frame()));
  const int num = request.corrections_size();
  if (num < 1 || num > static_cast<int>(kMaxCorrections)) {
    return BadField("corrections", absl::StrCat(num),
                    absl::StrCat("masks; allowed are 1..", kMaxCorrections));
  }
  for (int i = 0; i < num; ++i) {
    if (request.corrections(i).has_mask()) continue;
    return BadField(absl::StrCat("corrections[", i, "].mask"), "", "is required");
  }
  if (request.granularity().has_threshold()) {
    return BadField("granularity.threshold", absl::StrCat(request.granularity().threshold()),
                    "a correction makes its own; leave it out");
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<Correction>> ReadCorrections(const v1::CorrectSegmentRequest& request,
                                                        const SegmentRequestReader& reader) {
  std::vector<Correction> corrections;
  for (int i = 0; i < request.corrections_size(); ++i) {
    const std::string field = absl::StrCat("corrections[", i, "]");
    v1::Prompt prompt;
    *prompt.mutable_view() = request.corrections(i).view();
    *prompt.mutable_mask() = request.corrections(i).mask();
    const auto image_of = [&](const ModelView& view) {
      return Frame(view, FrameKindFromProto(request.frame()));
    };
    ASSIGN_OR_RETURN(Prompt read, reader.ReadPrompt(prompt, image_of, field));
    corrections.push_back({std::move(read.view), std::get<BinaryMask>(std::move(read.what))});
  }
  return corrections;
}

void Fill(const ResidentModel& model, const std::vector<Correction>& corrections,
          const CorrectedField& corrected, v1::CorrectSegmentResponse* response) {
  response->set_corrected_from(model.name);
  for (size_t i = 0; i < corrections.size(); ++i) {
    auto& score = *response->add_scores();
    score.set_view(corrections[i].view.name);
    score.set_iou_before(corrected.iou_before[i]);
    score.set_iou_after(corrected.iou_after[i]);
  }
  response->set_scale_quantile(corrected.scale);
  response->set_scale_units(ScaleOfQuantile(model->model().field, corrected.scale));
  response->set_threshold(corrected.threshold);
  response->set_num_changed(corrected.num_changed);
}

}  // namespace

absl::Status AnswerCorrectSegment(const UnaryCall& call, ModelLoader& models,
                                  const v1::CorrectSegmentRequest& request,
                                  v1::CorrectSegmentResponse* response) {
  RETURN_IF_ERROR(CheckRequest(request));
  Stopwatch stopwatch;
  const absl::Time begin = absl::Now();
  ASSIGN_OR_RETURN(const ResidentModel model,
                   models.LoadWithFeatures(call.scenes(), request.model(), "model"));
  v1::QueryTiming& timing = *response->mutable_timing();
  *timing.mutable_queue() = ToProto(call.queued);
  *timing.mutable_load() = ToProto(stopwatch.Lap());
  RETURN_IF_ERROR(call.CheckWanted());
  const SegmentRequestReader reader(model->model(), model.id, models.store());
  ASSIGN_OR_RETURN(const Granularity granularity,
                   reader.ReadGranularity(request.granularity(), "granularity"));
  ASSIGN_OR_RETURN(const std::vector<Correction> corrections, ReadCorrections(request, reader));
  ASSIGN_OR_RETURN(const auto memory,
                   models.TakeAnswerMemory(model.id.scene.project,
                                           BytesOfCorrection(model->model(), corrections.size())));
  const auto check = [&]() -> absl::Status {
    if (absl::Now() - begin > kTimeLimit) {
      return absl::DeadlineExceededError(
          absl::StrCat("the correction has taken longer than ", absl::FormatDuration(kTimeLimit)));
    }
    return call.CheckWanted();
  };
  const absl::StatusOr<CorrectedField> corrected =
      CorrectField(model->segmenter(), corrections, granularity.scale, check);
  RETURN_IF_ERROR(AtField(corrected.status(), "corrections"));
  *timing.mutable_compute() = ToProto(stopwatch.Lap());
  RETURN_IF_ERROR(check());
  Fill(model, corrections, *corrected, response);
  if (corrected->num_changed == 0) {
    response->set_model(model.name);
    return absl::OkStatus();
  }
  ASSIGN_OR_RETURN(const ModelRecord from, models.Find(model.id));
  ModelRecord made = from;
  made.edit.clear();
  ASSIGN_OR_RETURN(const ModelRecord record,
                   StoreVersion(models, from, made, [&](const auto& folder, const auto& to) {
                     return WriteCorrectedModel(folder, to, corrected->field, model.name);
                   }));
  response->set_model(ChildName(record.scene, "models", record.number));
  spdlog::info("{}: corrected from {}, {} Gaussians changed", response->model(), model.name,
               corrected->num_changed);
  // So that the next click need not wait. If there is no memory for it now, that click loads it.
  models.Load({record.scene, record.number}).status().IgnoreError();
  *timing.mutable_encode() = ToProto(stopwatch.Lap());
  return absl::OkStatus();
}

}  // namespace pepeseg
