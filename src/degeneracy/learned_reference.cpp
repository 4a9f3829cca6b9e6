// What scripts/learn_reference.py learned from street, street_hard, handheld, plaza, plaza_hard and mine,
// seed 1, 16 s each (docs/degeneracy.md).
#include "fdi_lio/degeneracy/degeneracy_config.hpp"

namespace fdi_lio::degeneracy {

const char* const kLearnedStructural =
    "0.0919 0.2273 0.1990 0.2000 0.1162 0.0626 0.0242 0.0222 0.0364 0.0202";
const char* const kLearnedSparse = "0.6475 0.1040 0.0859 0.0455 0.0657 0.0212 0.0071 0.0091 0.0091 0.0051";
const char* const kLearnedDynamic = "0.7273 0.1111 0.0182 0.0465 0.0768 0.0081 0.0030 0.0030 0.0030 0.0030";

}  // namespace fdi_lio::degeneracy
