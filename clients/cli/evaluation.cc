#include "clients/cli/evaluation.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace pepeseg::client::cli {
namespace {

constexpr size_t kNameColumns = 40;

std::string NameOf(const v1::EvaluateResponse::Entity& entity) {
  std::string name = absl::StrCat(entity.id());
  if (!entity.name().empty()) absl::StrAppend(&name, " ", entity.name());
  return name.substr(0, kNameColumns);
}

std::string Row(const v1::EvaluateResponse::Entity& entity, int columns) {
  std::string row =
      absl::StrFormat("%-*s  %5d  %5.3f  %5.3f", columns, NameOf(entity), entity.views_size() - 1,
                      entity.chosen().iou(), entity.chosen().boundary_iou());
  if (entity.missing()) {
    return absl::StrFormat("%s      -          -   %5.3f  nothing under the click", row,
                           entity.oracle().iou());
  }
  return absl::StrFormat("%s  %5.2f  %9.2f   %5.3f", row, entity.chosen().scale_quantile(),
                         entity.chosen().threshold(), entity.oracle().iou());
}

}  // namespace

std::vector<std::string> EvaluationTable(const v1::EvaluateResponse& answer) {
  const std::string last = absl::StrCat("mean of ", answer.entities_size());
  size_t widest = last.size();
  for (const auto& entity : answer.entities()) widest = std::max(widest, NameOf(entity).size());
  const int columns = static_cast<int>(widest);
  std::vector<std::string> rows = {
      absl::StrFormat("%-*s  views    IoU   BIoU  scale  threshold  oracle", columns, "entity")};
  for (const auto& entity : answer.entities()) rows.push_back(Row(entity, columns));
  rows.push_back(absl::StrFormat("%-*s         %5.3f  %5.3f                     %5.3f", columns,
                                 last, answer.chosen().iou(), answer.chosen().boundary_iou(),
                                 answer.oracle().iou()));
  if (answer.left_out_size() > 0) {
    rows.push_back(absl::StrCat("left out, in fewer than two held-out views: ",
                                absl::StrJoin(answer.left_out(), ", ")));
  }
  std::string scales =
      absl::StrFormat("fixed scale, threshold %.2f", answer.options().fixed_threshold());
  std::string means = absl::StrFormat("%-*s", static_cast<int>(scales.size()), "mean IoU");
  for (int k = 0; k < answer.fixed_iou_size(); ++k) {
    absl::StrAppendFormat(&scales, "  %5g", answer.options().fixed_scales(k));
    absl::StrAppendFormat(&means, "  %5.3f", answer.fixed_iou(k));
  }
  rows.insert(rows.end(), {"", scales, means});
  return rows;
}

}  // namespace pepeseg::client::cli
