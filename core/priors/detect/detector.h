#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/onnx/onnx_runtime.h"
#include "core/scene/capture.h"

namespace pepeseg {

// Files of a folder that deploy/detector.sh has made, besides ONNX Runtime. The words are one a
// line, in the order of the network's classes.
inline constexpr char kDetectorNetwork[] = "detector.onnx", kDetectorWords[] = "words.txt";

// Verifies the files of the folder against its SHA256SUMS. Returns NOT_FOUND when nothing is
// installed there, and FAILED_PRECONDITION, with the file and the remedy, when a file is missing or
// differs. Reads 30 MB.
absl::Status CheckDetectorFiles(const std::filesystem::path& folder);

// Returns the words of the folder, in lower case, each once, without loading the network. Returns
// the errors of ReadFile, and FAILED_PRECONDITION when they are not such words.
absl::StatusOr<std::vector<std::string>> ReadDetectorWords(const std::filesystem::path& folder);

// A thing that the detector has found in a photograph.
struct DetectedBox {
  int word = 0;                          // index into Detector::words()
  float score = 0;                       // of the network, (0, 1]
  float x0 = 0, y0 = 0, x1 = 0, y1 = 0;  // pixels; x1 and y1 are past the last one
};

struct DetectorOptions {
  int num_threads = 1;
  // The photograph is looked at as a whole and, if this is above 1, again in this many tiles along
  // each side, for small things.
  int tiles = 1;
};

// A small network that finds things of everyday words in photographs: a CenterNet for the classes
// of COCO, in ONNX Runtime on the CPU. Thread-safe.
class Detector {
 public:
  // Lowest score of a box, and most boxes of a photograph.
  static constexpr float kMinScore = 0.1F;
  static constexpr int kMaxBoxes = 200;
  static constexpr int kMaxWords = 10'000;

  // Verifies the files and loads the network. Returns the errors of CheckDetectorFiles;
  // FAILED_PRECONDITION when the library does not load or the files are not the expected ones, and
  // RESOURCE_EXHAUSTED when out of memory.
  static absl::StatusOr<std::unique_ptr<Detector>> Load(const std::filesystem::path& folder,
                                                        const DetectorOptions& options);

  // See ReadDetectorWords.
  const std::vector<std::string>& words() const { return words_; }

  // Returns the boxes of an RGB photograph, best score first. Boxes of one word do not overlap by
  // an IoU above 0.5. A thing may have boxes of several words. Takes about 0.15 s of a core for the
  // photograph and for each tile. Returns FAILED_PRECONDITION when the network is not the expected
  // one, and RESOURCE_EXHAUSTED when out of memory.
  absl::StatusOr<std::vector<DetectedBox>> Detect(const Image& photo) const;

 private:
  // Part of a photograph that the network looks at, pixels.
  struct Window {
    int x = 0, y = 0, width = 0, height = 0;
  };
  Detector() = default;
  std::vector<Window> WindowsOf(const Image& photo) const;
  absl::Status Look(const Image& photo, const Window& window,
                    std::vector<DetectedBox>& found) const;

  DetectorOptions options_;
  std::vector<std::string> words_;
  std::unique_ptr<OnnxRuntime> runtime_;
  std::unique_ptr<OnnxSession> session_;
};

}  // namespace pepeseg
