// The part of demo_report.h that draws.
#include <array>
#include <map>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "clients/cli/demo_report.h"
#include "clients/cli/questions.h"
#include "clients/cpp/status_macros.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::array<Rgb, 4> kColors = {
    {{230, 60, 60}, {60, 200, 80}, {70, 130, 255}, {250, 200, 40}}};
constexpr Rgb kWhite{255, 255, 255};

const ViewScore* Find(const ProductScore& score, const std::string& view) {
  for (const ViewScore& candidate : score.views) {
    if (candidate.view == view) return &candidate;
  }
  return nullptr;
}

absl::Status WriteProduct(const fs::path& folder, const DemoView& view, const Picture& render,
                          const ProductScore& score, Rgb color) {
  const ViewScore* found = Find(score, view.name);
  if (found == nullptr) return absl::OkStatus();
  Picture photo = view.photo;
  DrawOutline(photo, view.TruthOf(score.product.label), kWhite);
  if (found->clicked) DrawClick(photo, score.scores.click_x(), score.scores.click_y(), color);
  Picture overlay = view.photo;
  DrawMask(overlay, found->mask, color);
  const std::string name = absl::StrReplaceAll(score.product.name, {{"_", " "}});
  const std::array<Panel, 3> panels = {
      {{found->clicked ? "photo, the click, label in white" : "photo, label in white", photo},
       {absl::StrCat("rendering of a view never trained on"), render},
       {absl::StrFormat("%s: IoU %.2f", name, found->iou), overlay}}};
  const std::string file = absl::StrCat(score.product.name, "-", Stem(view.name), ".png");
  return WritePng(folder / file, SideBySide(panels));
}

absl::Status WriteOverview(const fs::path& folder, const DemoView& view, const Picture& render,
                           const DemoResult& result) {
  Picture overlay = view.photo;
  const std::vector<ProductScore>& products = result.scores.products;
  for (size_t i = 0; i < products.size(); ++i) {
    const ViewScore* found = Find(products[i], view.name);
    if (found == nullptr) continue;
    DrawMask(overlay, found->mask, kColors[i % kColors.size()]);
    if (found->clicked) {
      DrawClick(overlay, products[i].scores.click_x(), products[i].scores.click_y(), kWhite);
    }
  }
  const std::array<Panel, 3> panels = {{{"photo", view.photo},
                                        {"rendering of a view never trained on", render},
                                        {"what one click each selects", overlay}}};
  return WritePng(folder / absl::StrCat("overview-", Stem(view.name), ".png"), SideBySide(panels));
}

}  // namespace

absl::Status WritePictures(const fs::path& folder, const Client& client,
                           const std::vector<DemoView>& views, const DemoResult& result) {
  for (const DemoView& view : views) {
    ASSIGN_OR_RETURN(const Picture rendered, RenderView(client, result.model.name(), view.name));
    const Picture render = Resized(rendered, view.photo.width, view.photo.height);
    RETURN_IF_ERROR(WriteOverview(folder, view, render, result));
    const std::vector<ProductScore>& products = result.scores.products;
    for (size_t i = 0; i < products.size(); ++i) {
      RETURN_IF_ERROR(WriteProduct(folder, view, render, products[i], kColors[i % kColors.size()]));
    }
  }
  return absl::OkStatus();
}

}  // namespace pepeseg::client::cli
