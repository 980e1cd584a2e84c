#include "clients/cli/score_table.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace pepeseg::client::cli {
namespace {

constexpr size_t kViewsShown = 20;
constexpr size_t kViewColumns = 40;

std::string Row(const std::string& name, const v1::ImageScores& scores, size_t columns) {
  std::string row = absl::StrFormat("%-*s  %6.2f  %6.3f", static_cast<int>(columns), name,
                                    scores.psnr(), scores.ssim());
  if (scores.has_lpips()) absl::StrAppendFormat(&row, "  %6.3f", scores.lpips());
  return row;
}

// A long name's end tells more than its start.
std::string Shortened(const std::string& name) {
  if (name.size() <= kViewColumns) return name;
  return absl::StrCat("...", name.substr(name.size() - kViewColumns + 3));
}

v1::ImageScores MeanOf(const std::vector<v1::View>& views) {
  double psnr = 0, ssim = 0, lpips = 0;
  bool all_lpips = true;
  for (const v1::View& view : views) {
    psnr += view.scores().psnr();
    ssim += view.scores().ssim();
    lpips += view.scores().lpips();
    all_lpips = all_lpips && view.scores().has_lpips();
  }
  const auto count = static_cast<double>(views.size());
  v1::ImageScores mean;
  mean.set_psnr(psnr / count);
  mean.set_ssim(ssim / count);
  if (all_lpips) mean.set_lpips(lpips / count);
  return mean;
}

}  // namespace

std::vector<std::string> ScoreTable(std::span<const v1::View> views) {
  std::vector<v1::View> scored;
  std::copy_if(views.begin(), views.end(), std::back_inserter(scored),
               [](const v1::View& view) { return view.has_scores(); });
  if (scored.empty()) return {};
  const v1::ImageScores mean = MeanOf(scored);
  const std::string last = absl::StrCat("mean of ", scored.size());
  const bool cut = scored.size() > kViewsShown;
  if (cut) {
    std::stable_sort(scored.begin(), scored.end(), [](const v1::View& a, const v1::View& b) {
      return a.scores().psnr() < b.scores().psnr();
    });
    scored.resize(kViewsShown);
  }
  const std::string title = cut ? "worst held-out views" : "held-out view";
  size_t columns = std::max(title.size(), last.size());
  for (const v1::View& view : scored) columns = std::max(columns, Shortened(view.view()).size());
  std::vector<std::string> rows = {absl::StrFormat("%-*s    PSNR    SSIM%s",
                                                   static_cast<int>(columns), title,
                                                   mean.has_lpips() ? "   LPIPS" : "")};
  for (const v1::View& view : scored) {
    rows.push_back(Row(Shortened(view.view()), view.scores(), columns));
  }
  rows.push_back(Row(last, mean, columns));
  return rows;
}

}  // namespace pepeseg::client::cli
