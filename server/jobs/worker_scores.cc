#include "server/jobs/worker_scores.h"

#include <spdlog/spdlog.h>

#include "server/convert.h"

namespace pepeseg {

std::map<std::string, double> KeepScores(std::span<const ViewScores> scores, Model& model) {
  if (scores.empty()) return {};
  std::map<std::string, const ImageScores*> by_view;
  for (const ViewScores& view : scores) {
    spdlog::info("{}: PSNR {:.2f} dB, SSIM {:.4f}", view.view, view.scores.psnr, view.scores.ssim);
    by_view[view.view] = &view.scores;
  }
  for (ModelView& view : model.views) {
    if (const auto found = by_view.find(view.name); found != by_view.end()) {
      view.scores = *found->second;
    }
  }
  const ImageScores mean = Mean(scores);
  std::map<std::string, double> metrics = {{"psnr", mean.psnr}, {"ssim", mean.ssim}};
  if (mean.lpips) metrics["lpips"] = *mean.lpips;
  return metrics;
}

v1::JobEvent::StageEnded DescribeScores(std::span<const ViewScores> scores) {
  v1::JobEvent::StageEnded end;
  for (const ViewScores& view : scores) {
    v1::JobEvent::ViewScores& described = *end.add_views();
    described.set_view(view.view);
    *described.mutable_scores() = ToProto(view.scores);
  }
  return end;
}

}  // namespace pepeseg
