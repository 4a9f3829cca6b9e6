// What scripts/learn_reference.py learned from street, street_hard, handheld, plaza, plaza_hard and mine,
// seed 1, 16 s each (docs/degeneracy.md).
#include "fdi_lio/degeneracy/degeneracy_config.hpp"

namespace fdi_lio::degeneracy {

const char* const kLearnedStructural =
    "0.0030 0.0040 0.0040 0.1485 0.1768 0.3020 0.2606 0.0677 0.0303 0.0030";
const char* const kLearnedSparse = "0.6626 0.0414 0.0818 0.0404 0.0576 0.0293 0.0566 0.0081 0.0040 0.0182";
const char* const kLearnedDynamic = "0.7010 0.1172 0.0273 0.0111 0.0859 0.0455 0.0030 0.0030 0.0030 0.0030";

}  // namespace fdi_lio::degeneracy
