#include "clients/cli/annotations.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <system_error>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/cli/request_flags.h"
#include "clients/cpp/client.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/flags.h"
#include "clients/terminal/progress_line.h"
#include "clients/terminal/zip_files.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;

constexpr char kTable[] = "things.csv";  // in the zip

struct AnnotationFormat {
  const char* word;  // of --format
  v1::AnnotationFormat format;
};
constexpr AnnotationFormat kAnnotationFormats[] = {
    {"coco", v1::ANNOTATION_FORMAT_COCO},       {"yolo", v1::ANNOTATION_FORMAT_YOLO},
    {"labelme", v1::ANNOTATION_FORMAT_LABELME}, {"masks", v1::ANNOTATION_FORMAT_MASKS},
    {"cvat", v1::ANNOTATION_FORMAT_CVAT},       {"ids", v1::ANNOTATION_FORMAT_IDS}};

bool IsZip(const std::string& file) { return absl::EndsWithIgnoreCase(file, ".zip"); }

// Writes the files of the zip, and the table to its own place.
absl::Status UnpackAnnotations(const std::string& zip, v1::AnnotationFormat format,
                               const std::string& file, const std::string& table) {
  ASSIGN_OR_RETURN(const std::string bytes, ReadFile(zip));
  return ForEachZipFile(bytes, [&](const std::string& name, absl::string_view contents) {
    if (name == kTable && !table.empty()) return WriteFile(table, contents);
    if (IsZip(file)) return absl::OkStatus();
    return WriteFile(format == v1::ANNOTATION_FORMAT_COCO ? fs::path(file) : fs::path(file) / name,
                     contents);
  });
}

}  // namespace

void AddAnnotationFlags(CLI::App& verb, AnnotationFlags& flags) {
  AddNamesFlag(verb, "--labels", flags.labels, "Ids of the labels; by default all");
  verb.add_option("--segments", flags.level,
                  "Level of a decomposition whose segments are the things in place of the labels, "
                  "from 0, the finest; --scales has its scales")
      ->check(CLI::NonNegativeNumber);
  AddNamesFlag(verb, "--views", flags.views,
               "Views of the masks: names, all or held-out; by default all");
  verb.add_flag("!--no-sam-borders", flags.sam_borders,
                "Leave the borders of the masks to the model where SAM would place them");
  verb.add_option(
      "--table", flags.table,
      "CSV file for a table of the things: id, parent (the thing that it is a part of), name, "
      "category, instance, track, Gaussians, views that show it, its pixels in them, and its box "
      "in scene units");
}

std::vector<std::string> AnnotationFormats() {
  std::vector<std::string> words;
  for (const AnnotationFormat& format : kAnnotationFormats) words.emplace_back(format.word);
  return words;
}

absl::Status FetchAnnotations(const Shell& shell, const std::string& model,
                              const std::string& format, const std::string& file,
                              const AnnotationFlags& flags, const std::vector<double>& scales) {
  const auto* const found = std::ranges::find_if(
      kAnnotationFormats, [&](const AnnotationFormat& known) { return format == known.word; });
  if (found == std::ranges::end(kAnnotationFormats)) {
    return absl::InvalidArgumentError(absl::StrCat("--format ", format, ": no format of masks"));
  }
  v1::ExportAnnotationsRequest request;
  request.set_model(model);
  request.set_format(found->format);
  request.mutable_labels()->Add(flags.labels.begin(), flags.labels.end());
  if (flags.level >= 0) {
    request.mutable_segments()->set_level(flags.level);
    request.mutable_segments()->mutable_scales()->Add(scales.begin(), scales.end());
  }
  if (!flags.views.empty()) SetTargets(flags.views, *request.mutable_targets());
  if (!flags.sam_borders) request.set_sam_borders(false);
  request.set_table(!flags.table.empty());
  const std::string zip = IsZip(file) ? file : file + ".unpacking.zip";
  ProgressLine line;
  ASSIGN_OR_RETURN(
      const v1::ExportAnnotationsResponse::Header header,
      Client(shell.channel)
          .ExportAnnotations(
              request, zip, [&](const v1::ExportAnnotationsResponse::Progress& progress) {
                const int64_t done = progress.num_masks_done(), all = progress.num_masks();
                line.Show(absl::StrFormat("%d of %d masks", done, all), done == all);
              }));
  const absl::Status unpacked = UnpackAnnotations(zip, found->format, file, flags.table);
  if (!IsZip(file)) {
    std::error_code ignored;
    fs::remove(zip, ignored);
  }
  RETURN_IF_ERROR(unpacked);
  const char* const things = flags.level >= 0 ? "segments" : "labels";
  if (shell.json) {
    Print(nlohmann::ordered_json{{"file", file},
                                 {"format", format},
                                 {things, header.num_things()},
                                 {"views", header.num_views()}}
              .dump());
  } else {
    Print(absl::StrFormat("%s: %d %s in %d views, %s", file, header.num_things(), things,
                          header.num_views(), format));
  }
  return absl::OkStatus();
}

}  // namespace pepeseg::client::cli
