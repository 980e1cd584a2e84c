// The verb "find": all things that are alike, or that a text names.
#include "clients/cli/find.h"

#include <algorithm>
#include <filesystem>
#include <memory>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "clients/cli/request_flags.h"
#include "clients/cli/verbs.h"
#include "clients/cpp/client.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/shell.h"

namespace pepeseg::client::cli {
namespace {

namespace fs = std::filesystem;
using FoundThing = v1::FindSegmentsResponse::Found;

constexpr int kMostWords = 20;         // known words that an error lists
constexpr int kMostViews = 3;          // views of a row
constexpr double kServerMinimum = -1;  // of the score

struct FindFlags {
  PromptFlags prompt;
  GranularityFlags granularity;
  std::string text;
  int max_results = 0;  // 0: the server's default
  double min_score = kServerMinimum;
  std::string format = "table";
  std::string out;  // folder for PLY files; empty: none
};

std::string Triple(double x, double y, double z) {
  return absl::StrFormat("%.3g %.3g %.3g", x, y, z);
}

absl::StatusOr<v1::FindSegmentsRequest> BuildRequest(const FindFlags& flags) {
  if (flags.text.empty() == flags.prompt.parts.empty()) {
    return absl::InvalidArgumentError(
        "give what to find: either a TEXT, or one of the things, such as --view VIEW --point X,Y");
  }
  v1::FindSegmentsRequest request;
  request.set_model(ModelName(flags.prompt.scene, flags.prompt.model));
  if (flags.text.empty()) {
    ASSIGN_OR_RETURN(*request.mutable_like(), ParsePrompt(flags.prompt));
    *request.mutable_granularity() = ToGranularity(flags.granularity);
  } else {
    request.set_text(flags.text);
  }
  request.set_max_results(flags.max_results);
  if (flags.min_score != kServerMinimum) request.set_min_score(flags.min_score);
  request.set_frame(flags.prompt.frame);
  return request;
}

// Writes found_N.ply for each thing: the Gaussians of its segment, or those that its prompt means.
absl::Status ExportFound(const Client& client, const v1::FindSegmentsRequest& asked,
                         const v1::FindSegmentsResponse& answer, const std::string& folder) {
  for (int i = 0; i < answer.found_size(); ++i) {
    const FoundThing& found = answer.found(i);
    v1::ExportGaussiansRequest request;
    request.set_model(answer.model());
    if (found.has_segment()) {
      *request.mutable_subset()->mutable_segment() = found.segment();
    } else {
      v1::CreateSelectionRequest select;
      select.set_model(answer.model());
      *select.mutable_prompt() = found.prompt();
      *select.mutable_granularity() = found.granularity();
      select.set_frame(asked.frame());
      ASSIGN_OR_RETURN(const v1::Selection selection, client.Select(std::move(select)));
      request.mutable_subset()->set_selection(selection.name());
    }
    const fs::path file = fs::path(folder) / absl::StrCat("found_", i + 1, ".ply");
    RETURN_IF_ERROR(client.Export(request, file.string()).status());
  }
  Note(absl::StrCat("the Gaussians of ", answer.found_size(), " things are in ", folder));
  return absl::OkStatus();
}

absl::Status RunFind(const Shell& shell, const FindFlags& flags) {
  ASSIGN_OR_RETURN(const v1::FindSegmentsRequest request, BuildRequest(flags));
  const Client client(shell.channel);
  ASSIGN_OR_RETURN(const v1::FindSegmentsResponse answer, client.Find(request));
  if (shell.json || flags.format == "json") {
    PrintJson(answer);
  } else if (flags.format == "csv") {
    Print(ToCsv(FoundRows(answer)));
  } else if (!answer.found().empty()) {
    Print(absl::StrFormat("%s  %d things, by %s", answer.model(), answer.found_size(),
                          WordOf(answer.source())));
    for (const std::string& line : TextTable(FoundRows(answer))) Print(line);
  }
  RETURN_IF_ERROR(CheckFound(answer));
  return flags.out.empty() ? absl::OkStatus() : ExportFound(client, request, answer, flags.out);
}

}  // namespace

std::string WordOf(v1::FindSegmentsResponse::Source source) {
  switch (source) {
    case v1::FindSegmentsResponse::SOURCE_LABELS:
      return "labels";
    case v1::FindSegmentsResponse::SOURCE_DETECTOR:
      return "detector";
    case v1::FindSegmentsResponse::SOURCE_TEXT_COMMAND:
      return "text command";
    case v1::FindSegmentsResponse::SOURCE_APPEARANCE:
      return "appearance";
    default:
      return "";
  }
}

absl::Status CheckFound(const v1::FindSegmentsResponse& answer) {
  if (!answer.found().empty()) return absl::OkStatus();
  std::string message = "no such thing";
  if (answer.best_score() > 0) {
    absl::StrAppendFormat(&message, " (best: %.2f%s%s)", answer.best_score(),
                          answer.best_word().empty() ? "" : " ", answer.best_word());
  }
  if (!answer.did_you_mean().empty()) {
    absl::StrAppend(&message, "; did you mean ", absl::StrJoin(answer.did_you_mean(), ", "), "?");
  }
  if (!answer.known_words().empty()) {
    const int count = std::min(answer.known_words_size(), kMostWords);
    absl::StrAppend(
        &message, "; known words: ",
        absl::StrJoin(answer.known_words().begin(), answer.known_words().begin() + count, ", "),
        count < answer.known_words_size() ? ", ..." : "");
  }
  return absl::NotFoundError(message);
}

std::vector<TableRow> FoundRows(const v1::FindSegmentsResponse& answer) {
  std::vector<TableRow> rows = {{"#", "score", "what", "centre", "size", "Gaussians", "views"}};
  for (int i = 0; i < answer.found_size(); ++i) {
    const FoundThing& found = answer.found(i);
    const v1::Vector3 &min = found.box().min(), &max = found.box().max();
    const v1::SegmentRef& ref = found.segment();
    const bool is_piece = ref.scales_size() > 0 && ref.scales(0) == 0 && ref.level() == 0;
    const std::string segment = !found.has_segment() ? found.label()
                                : is_piece           ? absl::StrCat("piece ", ref.id())
                                                     : absl::StrCat(ref.level(), ":", ref.id());
    std::vector<std::string> views;
    for (const auto& seen : found.appearances()) {
      if (views.size() < kMostViews) views.push_back(seen.view());
    }
    TableRow row = {absl::StrCat(i + 1), absl::StrFormat("%.2f", found.score()),
                    found.word().empty() ? segment : found.word()};
    if (found.has_box()) {
      row.push_back(
          Triple((min.x() + max.x()) / 2, (min.y() + max.y()) / 2, (min.z() + max.z()) / 2));
      row.push_back(Triple(max.x() - min.x(), max.y() - min.y(), max.z() - min.z()));
    } else {
      row.insert(row.end(), {"", ""});
    }
    row.push_back(absl::StrCat(found.num_gaussians()));
    row.push_back(absl::StrJoin(views, " "));
    rows.push_back(std::move(row));
  }
  return rows;
}

std::string ToCsv(const std::vector<TableRow>& rows) {
  std::vector<std::string> lines;
  for (const TableRow& row : rows) {
    std::vector<std::string> cells;
    for (const std::string& cell : row) {
      const bool plain = cell.find_first_of(",\"\r\n") == std::string::npos;
      cells.push_back(
          plain ? cell : absl::StrCat("\"", absl::StrReplaceAll(cell, {{"\"", "\"\""}}), "\""));
    }
    lines.push_back(absl::StrJoin(cells, ","));
  }
  return absl::StrJoin(lines, "\n");
}

void AddFind(CLI::App& app, Shell& shell) {
  auto flags = std::make_shared<FindFlags>();
  CLI::App* verb =
      app.add_subcommand("find", "Find all things that are like one thing, or what a text names");
  AddPromptFlags(*verb, flags->prompt, /*optional=*/true);
  verb->add_option("TEXT", flags->text,
                   "What to find: a label of the scene, or another word that the server knows");
  AddGranularityFlags(*verb, flags->granularity);
  verb->add_option("--max", flags->max_results, "Maximum number of things; by default 100")
      ->check(CLI::Range(1, 200));
  verb->add_option("--min-score", flags->min_score,
                   "Things have at least this score; by default the server's minimum")
      ->check(CLI::Range(0.0, 1.0));
  verb->add_option("--format", flags->format, "table, json or csv")
      ->check(CLI::IsMember({"table", "json", "csv"}))
      ->capture_default_str();
  verb->add_option("--export", flags->out, "Folder for found_1.ply, found_2.ply, ...");
  verb->callback([flags, &shell] { shell.verb = [&, flags] { return RunFind(shell, *flags); }; });
}

}  // namespace pepeseg::client::cli
