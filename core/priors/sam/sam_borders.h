#pragma once

#include <filesystem>
#include <memory>
#include <span>

#include "absl/status/statusor.h"
#include "core/priors/sam/onnx_runtime.h"
#include "core/scene/capture.h"
#include "core/scene/mask_set.h"

namespace pepeseg {

struct SamNetworks;

// Moves the borders of masks to those that SAM's decoder sees in an image, prompted by the mask
// itself (METHOD.md section 4, "Borders by SAM"). Measured: tests/bench/results/borders.md.
// Thread-safe.
class SamBorders {
 public:
  // Loads the networks from a folder that deploy/sam.sh has made. They compute on the calling
  // thread and, with more than one thread, on threads of their own. Returns the errors of
  // SamNetworks::Open.
  static absl::StatusOr<std::unique_ptr<SamBorders>> Open(const std::filesystem::path& folder,
                                                          int num_threads);
  ~SamBorders();

  // Returns what Refine needs of an RGB image: 4 MB. Takes about a second of a core. Returns
  // RESOURCE_EXHAUSTED when out of memory.
  absl::StatusOr<OnnxTensor> Embed(const Image& image) const;

  // Returns the mask, [height, width] of the image with this embedding, with its border as SAM sees
  // it. Pixels farther from the border than 2 % of the image's diagonal stay. The mask stays as it
  // is where SAM sees another thing: one with an IoU of less than 0.7. Takes about 0.05 s of a
  // core. Returns the errors of Embed.
  absl::StatusOr<BinaryMask> Refine(const OnnxTensor& embedding, const BinaryMask& mask, int width,
                                    int height) const;

 private:
  explicit SamBorders(std::unique_ptr<const SamNetworks> networks);

  std::unique_ptr<const SamNetworks> networks_;
};

}  // namespace pepeseg
