#include "server/services/decompose_answer.h"

#include <algorithm>

#include "core/base/status_macros.h"
#include "server/api/rows_to_proto.h"
#include "server/services/answer_size.h"
#include "server/services/model_lookup.h"
#include "server/services/segment_lookup.h"
#include "server/services/stopwatch.h"

namespace pepeseg {
namespace {

void FillLevel(const Decomposition::Level& level, const Model& model,
               v1::DecomposeResponse::Level& out) {
  out.set_scale_quantile(level.scale);
  out.set_scale_units(ScaleOfQuantile(model.field, level.scale));
  out.set_num_unassigned(std::count(level.ids.begin(), level.ids.end(), 0));
  for (const Decomposition::Segment& segment : level.segments) {
    v1::DecomposeResponse::Segment& to = *out.add_segments();
    to.set_id(out.segments_size());
    to.set_parent(segment.parent);
    to.set_num_gaussians(segment.num_gaussians);
    to.mutable_min()->Add(segment.min.begin(), segment.min.end());
    to.mutable_max()->Add(segment.max.begin(), segment.max.end());
  }
}

}  // namespace

absl::Status AnswerDecompose(const UnaryCall& call, const ServiceContext& context,
                             const v1::DecomposeRequest& request, v1::DecomposeResponse* response) {
  ASSIGN_OR_RETURN(const std::vector<double> scales, ReadScales(request.scales(), "scales"));
  Stopwatch stopwatch;
  ASSIGN_OR_RETURN(const ResidentModel model,
                   LoadModelWithFeatures(context, request.model(), "model"));
  v1::QueryTiming& timing = *response->mutable_timing();
  *timing.mutable_queue() = ToProto(call.queued);
  *timing.mutable_load() = ToProto(stopwatch.Lap());
  // Once begun it is made to its end: whoever asks again finds it.
  RETURN_IF_ERROR(call.CheckWanted());
  RETURN_IF_ERROR(model.segmenter->WithDecomposition(scales, [&](const Decomposition& whole) {
    *timing.mutable_compute() = ToProto(stopwatch.Lap());
    for (const Decomposition::Level& level : whole.levels) {
      FillLevel(level, model.segmenter->model(), *response->add_levels());
    }
    return absl::OkStatus();
  }));
  *timing.mutable_encode() = ToProto(stopwatch.Lap());
  response->set_model(model.name);
  return CheckAnswerSize(response->ByteSizeLong());
}

}  // namespace pepeseg
