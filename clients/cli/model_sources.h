#pragma once

#include <string>

#include "pepeseg/v1/scene_service.pb.h"

namespace pepeseg::client::cli {

// "poses given, masks embedded, depth none"; empty when the server does not tell.
std::string SourcesText(const v1::Model& model);
// "mask quality 0.79: how far the masks of different views agree, 0 to 1"; empty where it was not
// measured.
std::string MaskQualityText(const v1::Model& model);
// Prints the server's advice on the model, one line for each reason why answers may be poor.
void PrintAdvice(const v1::Model& model);

}  // namespace pepeseg::client::cli
