#pragma once

#include "core/scene/capture.h"
#include "core/train/settings/stage_plan.h"
#include "core/train/settings/training_settings.h"
#include "core/train/training_inputs.h"

namespace pepeseg {

// Returns the facts that are known before any photograph is decoded. Reads transforms.json, the
// headers of videos, and those of at most 48 photographs; others are assumed to have their mean
// size, or one megapixel if none can be read. on_device: the backend computes on a GPU.
TrainingFacts FactsOf(const TrainingInputs& inputs, const TrainingSettings& settings,
                      bool on_device);

// Replaces the expected number and size of views by those of the capture.
void SetViews(const Capture& capture, TrainingFacts& facts);

}  // namespace pepeseg
