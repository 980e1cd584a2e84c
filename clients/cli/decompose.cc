// The verb "decompose": splits a model into segments and fetches them.
#include "clients/cli/decompose.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/find.h"
#include "clients/cli/request_flags.h"
#include "clients/cli/segment_table.h"
#include "clients/cli/verbs.h"
#include "clients/cpp/client.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/mask.h"
#include "clients/cpp/resource_names.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/view_picture.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using Decomposed = v1::DecomposeModelResponse;

// Appends the segments of `level` whose parent is `parent`, each followed by its own children.
void AddSegmentsOf(const Decomposed& answer, int level, int parent,
                   std::vector<std::string>& lines) {
  const std::string indent(static_cast<size_t>(2 * (answer.levels_size() - level)), ' ');
  for (const Decomposed::Segment& segment : answer.levels(level).segments()) {
    if (segment.parent() != parent) continue;
    const std::string name = absl::StrCat(indent, level, ":", segment.id());
    const v1::Vector3 &min = segment.box().min(), &max = segment.box().max();
    lines.push_back(absl::StrFormat("%-16s %9d Gaussians  %.3g x %.3g x %.3g scene units", name,
                                    segment.num_gaussians(), max.x() - min.x(), max.y() - min.y(),
                                    max.z() - min.z()));
    if (level > 0) AddSegmentsOf(answer, level - 1, segment.id(), lines);
  }
}

// Converts from HSV; hue is in [0, 1), saturation and value in [0, 1]. Channel n of RGB is
// value * (1 - saturation * clamp(min(k, 4 - k), 0, 1)) with k = (n + 6 hue) mod 6, n = 5, 3, 1.
Rgb FromHsv(double hue, double saturation, double value) {
  const auto channel = [&](double offset) {
    const double at = std::fmod(offset + hue * 6, 6);
    const double share = std::clamp(std::min(at, 4 - at), 0.0, 1.0);
    return static_cast<uint8_t>(std::lround(255 * value * (1 - saturation * share)));
  };
  return {channel(5), channel(3), channel(1)};
}

struct DecomposeFlags {
  std::string scene;
  std::string model = "live";
  std::vector<double> scales;
  std::string out;
  int level = -1;     // level whose segments are written; -1: the middle one
  std::string table;  // file to write
};

// Returns the level to write, or INVALID_ARGUMENT if the decomposition has no such level.
absl::StatusOr<int> ChooseLevel(const DecomposeFlags& flags, const Decomposed& answer) {
  if (flags.level < answer.levels_size()) {
    return flags.level < 0 ? answer.levels_size() / 2 : flags.level;
  }
  return absl::InvalidArgumentError(absl::StrCat("--level ", flags.level, ": must be below ",
                                                 answer.levels_size(), ", the number of levels"));
}

// Writes level_N/segment_ID.ply for each segment of a level.
absl::Status WriteSegments(const Client& client, const DecomposeFlags& flags,
                           const Decomposed& answer, int level) {
  const fs::path folder = fs::path(flags.out) / absl::StrCat("level_", level);
  v1::ExportGaussiansRequest request;
  request.set_model(answer.model());
  v1::SegmentRef& segment = *request.mutable_subset()->mutable_segment();
  for (const auto& of_level : answer.levels()) segment.add_scales(of_level.scale_quantile());
  segment.set_level(level);
  for (const Decomposed::Segment& written : answer.levels(level).segments()) {
    segment.set_id(written.id());
    const fs::path file = folder / absl::StrCat("segment_", written.id(), ".ply");
    RETURN_IF_ERROR(client.Export(request, file.string()).status());
  }
  return absl::OkStatus();
}

// Returns a request for pictures of the segments' ids, without level and view.
v1::RenderViewRequest IdsOf(const Decomposed& answer) {
  v1::RenderViewRequest request;
  request.set_model(answer.model());
  request.set_content(v1::RenderViewRequest::CONTENT_SEGMENTS);
  for (const auto& level : answer.levels()) {
    request.add_decomposition_scales(level.scale_quantile());
  }
  return request;
}

// Writes, for each view, STEM_ids.png (16-bit grey, as the server renders it) and STEM_colors.png.
absl::Status WriteViews(const Client& client, const DecomposeFlags& flags, const Decomposed& answer,
                        int level) {
  v1::RenderViewRequest request = IdsOf(answer);
  request.set_level(level);
  ASSIGN_OR_RETURN(const std::vector<v1::View> views, client.ListViews(answer.model()));
  for (const v1::View& view : views) {
    request.mutable_viewpoint()->set_view(view.view());
    ASSIGN_OR_RETURN(const v1::RenderViewResponse picture, client.Render(request));
    ASSIGN_OR_RETURN(const Grey16Picture ids, DecodeGrey16(picture.png(), view.view()));
    const std::string stem = (fs::path(flags.out) / Stem(view.view())).string();
    RETURN_IF_ERROR(WriteFile(stem + "_ids.png", picture.png()));
    RETURN_IF_ERROR(WritePng(stem + "_colors.png", ColorSegments(ids)));
  }
  return absl::OkStatus();
}

// Writes the table of all segments. Renders the ids of each level in each view at the size of its
// photograph.
absl::Status WriteTable(const Client& client, const DecomposeFlags& flags,
                        const Decomposed& answer) {
  SegmentTable table(answer);
  ASSIGN_OR_RETURN(const v1::ListLabelsResponse listed, client.ListLabels(SceneName(flags.scene)));
  std::vector<Mask> masks;  // of the labels, in their own views
  for (const v1::Label& listed_label : listed.labels()) {
    ASSIGN_OR_RETURN(const v1::Label label,
                     client.GetLabel(listed_label.name(), v1::PIXEL_FRAME_PHOTOGRAPH));
    ASSIGN_OR_RETURN(masks.emplace_back(), DecodeRle(label.mask().rle()));
  }
  v1::RenderViewRequest request = IdsOf(answer);
  request.set_frame(v1::PIXEL_FRAME_PHOTOGRAPH);
  constexpr int kMostSide = 16384;
  request.set_max_side(kMostSide);
  ASSIGN_OR_RETURN(const std::vector<v1::View> views, client.ListViews(answer.model()));
  for (const v1::View& view : views) {
    request.mutable_viewpoint()->set_view(view.view());
    for (int level = 0; level < answer.levels_size(); ++level) {
      request.set_level(level);
      ASSIGN_OR_RETURN(const v1::RenderViewResponse picture, client.Render(request));
      ASSIGN_OR_RETURN(const Grey16Picture ids, DecodeGrey16(picture.png(), view.view()));
      table.CountView(level, ids);
      for (int i = 0; i < listed.labels_size(); ++i) {
        const v1::Label& label = listed.labels(i);
        if (label.view() == view.view()) table.CompareLabel(label.text(), level, ids, masks[i]);
      }
    }
  }
  return WriteFile(flags.table, ToCsv(table.Rows()) + "\n");
}

absl::Status RunDecompose(const Shell& shell, const DecomposeFlags& flags) {
  const Client client(shell.channel);
  v1::DecomposeModelRequest request;
  request.set_model(ModelName(flags.scene, flags.model));
  request.mutable_scales()->Add(flags.scales.begin(), flags.scales.end());
  ASSIGN_OR_RETURN(const Decomposed answer, client.Decompose(request));
  ASSIGN_OR_RETURN(const int level, ChooseLevel(flags, answer));
  if (shell.json) {
    PrintJson(answer);
  } else {
    for (const std::string& line : SegmentTree(answer)) Print(line);
  }
  if (!flags.table.empty()) RETURN_IF_ERROR(WriteTable(client, flags, answer));
  if (flags.out.empty()) return absl::OkStatus();
  RETURN_IF_ERROR(WriteSegments(client, flags, answer, level));
  RETURN_IF_ERROR(WriteViews(client, flags, answer, level));
  Note(absl::StrFormat("%d segments of level %d and pictures of the views are in %s",
                       answer.levels(level).segments_size(), level, flags.out));
  return absl::OkStatus();
}

}  // namespace

std::vector<std::string> SegmentTree(const Decomposed& answer) {
  std::vector<std::string> lines = {answer.model()};
  lines.reserve(static_cast<size_t>(answer.levels_size()) + 1);
  for (int i = 0; i < answer.levels_size(); ++i) {
    const Decomposed::Level& level = answer.levels(i);
    lines.push_back(absl::StrFormat(
        "level %d  scale %.3g (%.4g scene units)  %d segments  %d Gaussians in none", i,
        level.scale_quantile(), level.scale_units(), level.segments_size(),
        level.num_unassigned()));
  }
  if (answer.levels_size() > 0) AddSegmentsOf(answer, answer.levels_size() - 1, 0, lines);
  return lines;
}

Rgb ColorOfSegment(int id) {
  if (id <= 0) return {};
  // Steps by the golden ratio spread the hues of any number of ids evenly.
  const double hue = std::fmod(0.618033988749895 * id, 1);
  constexpr double kSaturations[] = {0.85, 0.55}, kValues[] = {1, 0.75, 0.9};
  return FromHsv(hue, kSaturations[id % 2], kValues[id % 3]);
}

Picture ColorSegments(const Grey16Picture& ids) {
  Picture picture = Picture::Filled(ids.width, ids.height, {});
  std::map<uint16_t, Rgb> colors;
  for (size_t i = 0; i < ids.pixels.size(); ++i) {
    const auto found = colors.try_emplace(ids.pixels[i], ColorOfSegment(ids.pixels[i])).first;
    picture.pixels[3 * i] = found->second.r;
    picture.pixels[3 * i + 1] = found->second.g;
    picture.pixels[3 * i + 2] = found->second.b;
  }
  return picture;
}

void AddDecompose(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<DecomposeFlags>();
  CLI::App* verb = app.add_subcommand("decompose", "Split a model into parts, objects and groups");
  verb->add_option("SCENE", flags->scene, "Id of the scene")->required();
  AddScalesFlag(*verb, flags->scales);
  verb->add_option("--model", flags->model, "Number of the model, or a job: jobs/j3")
      ->capture_default_str();
  verb->add_option(
      "--out", flags->out,
      "Folder for level_N/segment_ID.ply and, for each view, STEM_ids.png (16-bit grey: the "
      "segment's id, 0 for none) and STEM_colors.png");
  verb->add_option("--level", flags->level,
                   "Level to write, from 0, the finest; by default the middle one")
      ->check(CLI::NonNegativeNumber);
  verb->add_option(
      "--table", flags->table,
      "CSV file for a table of all segments of all levels: level, id, parent, name (of "
      "a label whose mask it has), Gaussians, views that show it, its pixels in them, "
      "and its box in scene units");
  verb->callback(
      [flags, &shell] { shell.verb = [&, flags] { return RunDecompose(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
