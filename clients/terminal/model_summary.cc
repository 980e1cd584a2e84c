#include "clients/terminal/model_summary.h"

#include <algorithm>
#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/view_picture.h"

namespace pepeseg::client::cli {
namespace {

constexpr size_t kMaxRows = 20;      // of the table of views
constexpr size_t kViewColumns = 40;  // longest name of a view in it

std::string ScoreRow(const std::string& name, const v1::ImageScores& scores, size_t columns) {
  std::string row = absl::StrFormat("%-*s  %6.2f  %6.3f", static_cast<int>(columns), name,
                                    scores.psnr(), scores.ssim());
  if (scores.has_lpips()) absl::StrAppendFormat(&row, "  %6.3f", scores.lpips());
  return row;
}

// Cuts a long name at its start: the names of views differ at their ends.
std::string Shortened(const std::string& name) {
  if (name.size() <= kViewColumns) return name;
  return absl::StrCat("...", name.substr(name.size() - kViewColumns + 3));
}

// Returns the mean scores, with LPIPS if all views have it.
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

// Returns true if a command without --server goes to `server` as well.
bool IsNamedByEnvironment(const std::string& server) {
  const char* named = std::getenv("PEPESEG_SERVER");
  return server == (named == nullptr ? Shell().server : named);
}

// Returns the middle one of the views trained on, or of all views if there are none.
const v1::View& MiddleView(const std::vector<v1::View>& views) {
  std::vector<const v1::View*> trained;
  for (const v1::View& view : views) {
    if (!view.held_out()) trained.push_back(&view);
  }
  return trained.empty() ? views[views.size() / 2] : *trained[trained.size() / 2];
}

}  // namespace

std::string SourcesText(const v1::Model& model) {
  std::string text;
  const auto append = [&text](const char* what, const std::string& source) {
    if (source.empty()) return;
    absl::StrAppend(&text, text.empty() ? "" : ", ", what, " ", source);
  };
  append("poses", model.sources().poses());
  append("masks", model.sources().masks());
  append("depth", model.sources().depth());
  return text;
}

double MetricOf(const v1::Model& model, const std::string& name) {
  const auto found = model.metrics().find(name);
  return found == model.metrics().end() ? 0 : found->second;
}

std::string MaskQualityText(const v1::Model& model) {
  const auto quality = model.metrics().find("mask_quality");
  if (quality == model.metrics().end()) return "";
  return absl::StrFormat("mask quality %.2f: how far the masks of different views agree, 0 to 1",
                         quality->second);
}

void PrintAdvice(const v1::Model& model) {
  for (const std::string& advice : model.advice()) Print("advice: " + advice);
}

std::vector<std::string> ScoreTable(std::span<const v1::View> views) {
  std::vector<v1::View> scored;
  std::copy_if(views.begin(), views.end(), std::back_inserter(scored),
               [](const v1::View& view) { return view.has_scores(); });
  if (scored.empty()) return {};
  const v1::ImageScores mean = MeanOf(scored);
  const std::string last = absl::StrCat("mean of ", scored.size());
  const bool cut = scored.size() > kMaxRows;
  if (cut) {
    std::stable_sort(scored.begin(), scored.end(), [](const v1::View& a, const v1::View& b) {
      return a.scores().psnr() < b.scores().psnr();
    });
    scored.resize(kMaxRows);
  }
  const std::string title = cut ? "worst held-out views" : "held-out view";
  size_t columns = std::max(title.size(), last.size());
  for (const v1::View& view : scored) columns = std::max(columns, Shortened(view.view()).size());
  std::vector<std::string> rows = {absl::StrFormat("%-*s    PSNR    SSIM%s",
                                                   static_cast<int>(columns), title,
                                                   mean.has_lpips() ? "   LPIPS" : "")};
  for (const v1::View& view : scored) {
    rows.push_back(ScoreRow(Shortened(view.view()), view.scores(), columns));
  }
  rows.push_back(ScoreRow(last, mean, columns));
  return rows;
}

std::string CommandText(const Shell& shell, const std::vector<std::string>& words) {
  std::string text = Quoted(shell.program);
  for (const std::string& word : words) absl::StrAppend(&text, " ", Quoted(word));
  if (!IsNamedByEnvironment(shell.server)) absl::StrAppend(&text, " --server ", shell.server);
  return text;
}

std::string FirstCommand(const Shell& shell, const v1::Model& model,
                         const std::vector<v1::View>& views) {
  const std::string scene = SceneOf(model.name()).substr(std::string("scenes/").size());
  if (model.sources().masks() == "none" || views.empty()) {
    return CommandText(shell, {"export", scene, absl::StrCat(scene, ".ply")});
  }
  const v1::View& view = MiddleView(views);
  const auto [width, height] = PhotographSize(view);
  return CommandText(
      shell, {"segment", scene, "--view", view.view(), "--point",
              absl::StrCat(width / 2, ",", height / 2), "--views", "all", "--out", "masks"});
}

absl::Status PrintTrained(const Shell& shell, const Client& client, const std::string& model) {
  ASSIGN_OR_RETURN(const v1::Model answer, client.GetModel(model));
  if (const std::string sources = SourcesText(answer); !sources.empty()) {
    Print("trained on: " + sources);
  }
  if (const std::string quality = MaskQualityText(answer); !quality.empty()) Print(quality);
  PrintAdvice(answer);
  ASSIGN_OR_RETURN(const std::vector<v1::View> views, client.ListViews(model));
  for (const std::string& row : ScoreTable(views)) Print(row);
  Print(absl::StrCat("Next: ", FirstCommand(shell, answer, views)));
  return absl::OkStatus();
}

}  // namespace pepeseg::client::cli
