#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "absl/time/time.h"

// The protocol between the server and `pepeseg-worker --text=TASK`, which runs the operator's
// program that finds what a text names in photographs (pepesegd --text-command):
//
//   PROGRAM --photos FOLDER --text TEXT --out FOLDER
//
//   --photos   000001.png, 000002.png, ...: photographs of one scene, 8-bit RGB
//   --text     what to find, such as "the red cup"
//   --out      where to write. The folder exists and is empty. STEM.json (000001.json): a list of
//              {"score": 0.7, "box": [x0, y0, x1, y1]}, or with a mask, {"score": 0.7,
//              "segmentation": {"size": [height, width], "counts": ...}} in COCO's run lengths,
//              compressed or not; pixels of the photograph. Other fields are ignored. A photograph
//              without a file shows nothing of the kind.
//
// It ends with exit code 0, or its last lines say what went wrong.
namespace pepeseg {

struct TextTask {
  std::string program;           // an absolute path
  std::filesystem::path folder;  // of this run: TextPhotos, TextAnswers, TextLog
  std::string text;
  absl::Duration time_limit;
  // As those of a job (WorkerOptions).
  std::vector<std::string> sandbox_reads, pass_environment;
  int64_t memory_limit = 0;  // bytes
  int num_threads = 0;       // 0: one per core
  bool sandbox = true;
};

inline std::filesystem::path TextPhotos(const std::filesystem::path& folder) {
  return folder / "photos";
}
inline std::filesystem::path TextAnswers(const std::filesystem::path& folder) {
  return folder / "made";
}
// Standard output and error of the program.
inline std::filesystem::path TextLog(const std::filesystem::path& folder) {
  return folder / "made" / "output.log";
}
// Returns the name of a photograph's files without their suffix. photo: from 0.
std::string TextStem(size_t photo);

std::string FormatTextTask(const TextTask& task);
// Parses what FormatTextTask returns. INVALID_ARGUMENT: `text` is something else.
absl::StatusOr<TextTask> ParseTextTask(absl::string_view text);

}  // namespace pepeseg
