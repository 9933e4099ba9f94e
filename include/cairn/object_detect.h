/* object_detect: objects of a class in a picture's edges, from one model of its outline.
 *
 * Every place and size is looked at: what each edge is worth for the outline there, against what edges near it come to by chance.
 * The best places are looked at again with the outline bent onto the edges (contour_search), and verified by contour grouping. Or, as in the thesis, places come from parts:
 * fragments of the outline along chains of edges that agree. Image coordinates, pixels.
 *
 * As written (CAIRN_MODE_AS_WRITTEN): all configurations of the K nearest of all votes, those of little similarity left out, ranked by the shape
 * context distance of their edge fragments to the whole outline, with appearance by eq. 5.1; boxes are those about the fragments; nothing is bent,
 * grouped or verified. Choices, where the text is silent: those of part_bundle, fragment_match and part_configuration; sums of similarity
 * below 0.5 are left out, and all but the 65,536 greatest of the model and of its mirror image, more than K = 20 near votes of 4 bundles make; a
 * match votes whatever its similarity; configurations of the same edge fragments are one hypothesis, that of the greatest sum; the shape
 * of a hypothesis is that of its whole edge fragments, 64 even points against 64 of the outline, not warped first; the distance is the sum of the mean costs of
 * the best matches in both directions (Belongie et al. 2002); of boxes that share more than `overlap` of their union the best one stays. d_app of eq. 5.1 is the distance to the nearest of the words that were learnt,
 * as the experiments have it (section 5.4.2); by what the machine says (section 5.3.2) with `appearance_nearest` 0: 1 less its probability. */
#ifndef CAIRN_OBJECT_DETECT_H
#define CAIRN_OBJECT_DETECT_H

#include "cairn/appearance.h"
#include "cairn/contour_search.h"
#include "cairn/part_bundle.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef int32_t cairn_detect_method;
enum {
    CAIRN_DETECT_EVIDENCE = 0, /* every place and size, by what edges are worth there */
    CAIRN_DETECT_PARTS = 1     /* configurations of parts, by shape contexts (Adluru 2008, chapter 5) */
};

typedef int32_t cairn_detect_bundles;
enum {
    CAIRN_DETECT_BUNDLES = 0,        /* of each bundle one fragment or none */
    CAIRN_DETECT_BUNDLES_OF_ONE = 1, /* of each bundle only the longest fragment is looked for */
    CAIRN_DETECT_NO_BUNDLES = 2      /* each fragment is a bundle of its own */
};

/* What a search does, one after the other; of PARTS the first two for the model and again for its mirror image. */
typedef int32_t cairn_detect_stage;
enum {
    CAIRN_DETECT_VOTES = 0,  /* places are looked for, fragments matched */
    CAIRN_DETECT_SCORES = 1, /* outlines bent onto the edges; of PARTS shapes compared */
    CAIRN_DETECT_BOXES = 2   /* the best stays of those that overlap; of PARTS outlines bent, too */
};

typedef struct cairn_object_detect_params {
    /* px, of the diagonal of the object's box: 8 <= min <= max <= 2 CAIRN_CONTOUR_SIDE_MOST, min at least a fiftieth of the picture's longer
     * side. */
    cairn_real min_size, max_size;
    int32_t mirror;     /* 1: the mirrored model is looked for, too (1) */
    int32_t candidates; /* 1 ... 64: places that are looked at again (30) */
    cairn_real
        overlap; /* 0 ... 1: of two detections whose boxes share more, over their union, the better one stays (0.2); so it does when
                                      most of the smaller box lies in the other */
    cairn_real min_score;       /* detections of a worse one, before appearance counts, are not reported (0) */
    cairn_detect_method method; /* (EVIDENCE) */
    /* Of PARTS: */
    cairn_detect_bundles bundles; /* (BUNDLES) */
    const cairn_part_cut *cuts;   /* [cut_count] fragments by hand of the first outline; NULL: by rule (NULL) */
    int32_t cut_count;
    int32_t matches;                          /* 1 ... 64: chains that vote for each fragment (2, as in the thesis) */
    int32_t nearest;                          /* 1 ... 64: votes that configurations are made of, near each vote (20) */
    int32_t modes;                            /* 1: near the modes of the votes only (0) */
    const cairn_appearance_field *appearance; /* of the same image: what is in a box counts; NULL: it does not (NULL) */
    cairn_real appearance_weight; /* 0 ... 1000: what a score loses for the unlikely, lambda of the thesis (8) */
    void (*on_stage)(void *context, cairn_detect_stage stage); /* told when a stage begins; NULL: nobody (NULL) */
    void *on_stage_context;
    /* Of EVIDENCE, 1: objects may be hidden in part, and have the model's own shape. Only what agrees on one similarity map of the drawn outline
     * counts (agreed), whatever became of the rest, with the evidence of what is grouped there, and what is grouped makes up to `candidates`
     * candidates more; outlines are laid by that map, not bent. Among many edges it finds more that is false (0). */
    int32_t occluded;
    /* Of EVIDENCE, 0 ... 100: what a score gains for each unit of evidence of a contour grouped at its place (grouped; contour_grouping). Of a
     * search it takes more than half the time. 0: nothing is grouped, but with `occluded`, which counts it by a weight of its own (0.08). */
    cairn_real verify;
    int32_t mode; /* CAIRN_MODE_DEFAULT, or CAIRN_MODE_AS_WRITTEN, of PARTS only (DEFAULT) */
    /* 0: appearance is the probability of the machine (Adluru 2008, section 5.3.2); 1, as written only: 1 less the distance to the nearest words
     * that were learnt (section 5.4.2) (0; as written 1). */
    int32_t appearance_nearest;
} cairn_object_detect_params;

/* The values in brackets above; sizes from a tenth of the picture's diagonal, at least 24 px, to the whole. */
cairn_object_detect_params cairn_object_detect_default(int32_t width, int32_t height);

/* CAIRN_MODE_AS_WRITTEN by PARTS with the thesis's constants: 2 matches a fragment, K = 20, lambda = 8; nothing is verified. */
cairn_object_detect_params cairn_object_detect_as_written(int32_t width, int32_t height);

/* What was found. rigid and bent: the mean over the outline's samples of the logarithm of how much likelier the edges there are with the
 * object than by chance, where the model was laid first, and where its bent outline lies, less what bending costs. */
typedef struct cairn_detection {
    cairn_real left, top, right, bottom; /* px, the box about the bent outline */
    /* Of rigid, bent, close, turned, strained, the box's proportions, the size to the picture's diagonal, and grouped; with `occluded` of
     * agreed, grouped and that size. */
    cairn_real score;
    cairn_real rigid, bent;
    cairn_real along;    /* length of the segments to that of the outline */
    cairn_real close;    /* 0 ... 1, mean over the bent outline of how near an edge of its direction is */
    cairn_real turned;   /* 0 ... 2, mean of 1 - cos of the angles between the bent outline and the drawn one */
    cairn_real strained; /* 0 ... 1, rms of what an affine map of the drawn outline leaves of the bent one, in sizes */
    cairn_real
        agreed; /* 0 ... 1, as close, of what lies where one similarity map of the drawn outline lays it, too: seen and not bent */
    /* The most evidence of what contour grouping finds, in all sizes and turned by up to 15 degrees either way, with a box that shares half of
     * their union with this one; 0: nothing, or nobody asked. */
    cairn_real grouped;
    cairn_vec2 origin;     /* px, where the model's origin lies */
    cairn_real size;       /* px, of the diagonal of the model's box */
    int32_t mirrored;      /* 1: it is the mirrored model */
    int32_t first_segment; /* segments[first_segment ... + segment_count - 1]: those along the outline */
    int32_t segment_count;
    int32_t first_outline; /* outline[first_outline ... + outline_count - 1] */
    int32_t outline_count; /* the model's */
    /* Of PARTS, else 0; there, as of candidates by grouping, rigid is 0, and score = 1 - distance. With appearance a score is less by appearance_weight (1 - appearance). */
    cairn_real distance;            /* of the parts from the outline by their shape contexts, with what is missing */
    cairn_real agreement;           /* score of the configuration (part_configuration) */
    int32_t first_part, part_count; /* parts[first_part ... first_part + part_count - 1] */
    cairn_real
        appearance; /* how likely what is in the box shows the class, or how near it is to what was learnt, 0 ... 1; 0 without appearance */
} cairn_detection;

/* A fragment of the model's outline (part_bundle, by rule) where it was found. */
typedef struct cairn_detected_part {
    int32_t bundle, fragment, chain; /* chain: of the tokens */
    int32_t reversed;                /* 1: the chain runs against the outline */
    cairn_real similarity;           /* 0 ... 1 */
    cairn_real from, to;             /* px along the chain */
} cairn_detected_part;

/* segments and outline keep what belonged to detections that were dropped, too. */
typedef struct cairn_detections {
    cairn_detection *found;       /* [count] the best first */
    int32_t *segments;            /* [segment_count] indices of the tokens' lines */
    cairn_contour_place *outline; /* [outline_count] */
    cairn_detected_part *parts;   /* [part_count] */
    int32_t count, segment_count, outline_count, part_count;
    int32_t bundles;        /* of the model; 0: not looked for by parts */
    int32_t has_appearance; /* 1: it counted */
} cairn_detections;

/* What all models are looked for in: made once of a picture. */
typedef struct cairn_detect_field cairn_detect_field;

/* Makes the field of all sizes within params. `tokens` must stay. CAIRN_BAD_ARGUMENT: params; CAIRN_NO_MEMORY. On failure there is nothing to
 * free, and *field is NULL. `path` is named by the error. */
CAIRN_CHECKED cairn_status cairn_detect_field_make(cairn_detect_field **field, const cairn_contour_tokens *tokens,
                                                   const cairn_object_detect_params *params, const char *path,
                                                   cairn_file_error *error);
void cairn_detect_field_free(cairn_detect_field *field);

/* Looks for a model. CAIRN_BAD_ARGUMENT, CAIRN_NOT_FINITE: a model that cairn_shape_model_check refuses; CAIRN_BAD_ARGUMENT: one with fewer
 * than 3 places of an outline, without a width or a height, or one that lies 0.54 of its size or farther from its middle; by parts also what
 * cairn_part_bundle_begin() refuses (CAIRN_EMPTY, CAIRN_FULL, CAIRN_BAD_ARGUMENT: cuts); CAIRN_NO_MEMORY. On failure there is nothing to
 * free. */
CAIRN_CHECKED cairn_status cairn_object_detect(cairn_detections *detections, const cairn_detect_field *field,
                                               const cairn_shape_model *model, const char *path,
                                               cairn_file_error *error);

void cairn_detections_free(cairn_detections *detections);

#ifdef __cplusplus
}
#endif

#endif
