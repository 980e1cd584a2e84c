#pragma once

#include <map>
#include <string>
#include <vector>

// Advice to users about masks: why segments may be poor, and how to get better masks.
namespace pepeseg {

// Returns advice on a model whose masks were made by the built-in method, or that has none. Empty
// if masks were given or made by SAM or a command, and if `sources` (JobResult::sources) does not
// say.
std::vector<std::string> AdviceOnModel(const std::map<std::string, std::string>& sources);

// Returns advice on a model by its metric "mask_quality" (see Model.metrics). Empty from
// kGoodMaskQuality on, and if AdviceOnModel has advice.
inline constexpr double kGoodMaskQuality = 0.5;
std::vector<std::string> AdviceOnMaskQuality(const std::map<std::string, std::string>& sources,
                                             double mask_quality);

// Returns advice on a dataset. Empty if it has masks, or if the server has SAM or a priors command
// to make them.
std::vector<std::string> AdviceOnDataset(bool has_masks, bool has_mask_maker);

}  // namespace pepeseg
