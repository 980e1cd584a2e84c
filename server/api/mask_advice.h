#pragma once

#include <map>
#include <string>
#include <vector>

// Sentences for people about masks: why segments may be poor, and how to get better masks.
namespace pepeseg {

// Advice on a model, by JobResult::sources: masks made by the built-in method, or none. Empty where
// masks were given or made by SAM or a command, and where `sources` does not say.
std::vector<std::string> AdviceOnModel(const std::map<std::string, std::string>& sources);

// Advice on a model's metric "mask_quality" (see Model.metrics). Empty from kGoodMaskQuality on,
// and where `sources` is advised on already.
inline constexpr double kGoodMaskQuality = 0.5;
std::vector<std::string> AdviceOnMaskQuality(const std::map<std::string, std::string>& sources,
                                             double mask_quality);

// Advice on a dataset. Empty where it has masks, or the server has SAM or a priors command to make
// them.
std::vector<std::string> AdviceOnDataset(bool has_masks, bool has_mask_maker);

}  // namespace pepeseg
