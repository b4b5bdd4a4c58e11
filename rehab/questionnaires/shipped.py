"""The questionnaires that GARRY brings: only those that anybody may use.

Sources and licenses: docs/reference/questionnaires.md#sus and below. The Intrinsic Motivation
Inventory is not among them, since its items are copyrighted; a clinic that may use it enters it as
its own.
"""

from __future__ import annotations

from rehab.questionnaires.instrument import ENGLISH, Instrument, Item, Scoring

Words = dict[str, str]

# The translations are GARRY's own and were not validated with patients.
_DISAGREE: Words = {
    "en": "Strongly disagree",
    "es": "Totalmente en desacuerdo",
    "de": "Stimme gar nicht zu",
    "fr": "Pas du tout d’accord",
}
_AGREE: Words = {
    "en": "Strongly agree",
    "es": "Totalmente de acuerdo",
    "de": "Stimme voll zu",
    "fr": "Tout à fait d’accord",
}
_SUS_ITEMS: tuple[Words, ...] = (
    {
        "en": "I think that I would like to use this system frequently.",
        "es": "Creo que me gustaría usar este sistema con frecuencia.",
        "de": "Ich denke, dass ich dieses System gern häufig nutzen würde.",
        "fr": "Je pense que j’aimerais utiliser ce système fréquemment.",
    },
    {
        "en": "I found the system unnecessarily complex.",
        "es": "Encontré el sistema innecesariamente complejo.",
        "de": "Ich fand das System unnötig kompliziert.",
        "fr": "J’ai trouvé ce système inutilement complexe.",
    },
    {
        "en": "I thought the system was easy to use.",
        "es": "Me pareció que el sistema era fácil de usar.",
        "de": "Ich fand das System einfach zu nutzen.",
        "fr": "J’ai trouvé ce système facile à utiliser.",
    },
    {
        "en": "I think that I would need the support of a technical person to be able to use this "
        "system.",
        "es": "Creo que necesitaría la ayuda de un técnico para poder usar este sistema.",
        "de": "Ich denke, dass ich technische Hilfe bräuchte, um dieses System zu nutzen.",
        "fr": "Je pense que j’aurais besoin de l’aide d’un technicien pour utiliser ce système.",
    },
    {
        "en": "I found the various functions in this system were well integrated.",
        "es": "Encontré que las diversas funciones de este sistema estaban bien integradas.",
        "de": "Ich fand, dass die Funktionen dieses Systems gut zusammenpassen.",
        "fr": "J’ai trouvé que les fonctions de ce système étaient bien intégrées.",
    },
    {
        "en": "I thought there was too much inconsistency in this system.",
        "es": "Me pareció que había demasiada inconsistencia en este sistema.",
        "de": "Ich fand, dass in diesem System zu vieles nicht einheitlich ist.",
        "fr": "J’ai trouvé qu’il y avait trop d’incohérences dans ce système.",
    },
    {
        "en": "I would imagine that most people would learn to use this system very quickly.",
        "es": "Imagino que la mayoría de la gente aprendería a usar este sistema muy deprisa.",
        "de": "Ich glaube, dass die meisten Menschen dieses System sehr schnell lernen.",
        "fr": "J’imagine que la plupart des gens apprendraient très vite à utiliser ce système.",
    },
    {
        "en": "I found the system very cumbersome to use.",
        "es": "Encontré el sistema muy engorroso de usar.",
        "de": "Ich fand das System sehr umständlich zu nutzen.",
        "fr": "J’ai trouvé ce système très lourd à utiliser.",
    },
    {
        "en": "I felt very confident using the system.",
        "es": "Me sentí con mucha confianza al usar el sistema.",
        "de": "Ich fühlte mich bei der Nutzung des Systems sehr sicher.",
        "fr": "Je me suis senti très en confiance en utilisant ce système.",
    },
    {
        "en": "I needed to learn a lot of things before I could get going with this system.",
        "es": "Tuve que aprender muchas cosas antes de poder empezar con este sistema.",
        "de": "Ich musste viel lernen, bevor ich mit diesem System anfangen konnte.",
        "fr": "J’ai dû apprendre beaucoup de choses avant de pouvoir utiliser ce système.",
    },
)
_LOW: Words = {"en": "Very low", "es": "Muy baja", "de": "Sehr gering", "fr": "Très faible"}
_HIGH: Words = {"en": "Very high", "es": "Muy alta", "de": "Sehr hoch", "fr": "Très élevé"}
_PERFECT: Words = {"en": "Perfect", "es": "Perfecto", "de": "Perfekt", "fr": "Parfait"}
_FAILURE: Words = {"en": "Failure", "es": "Fracaso", "de": "Misserfolg", "fr": "Échec"}
_TLX_ITEMS: tuple[tuple[Words, Words, Words], ...] = (
    (
        {
            "en": "How mentally demanding was the task?",
            "es": "¿Qué exigencia mental tuvo la tarea?",
            "de": "Wie hoch war die geistige Anforderung der Aufgabe?",
            "fr": "À quel point la tâche était-elle exigeante mentalement ?",
        },
        _LOW,
        _HIGH,
    ),
    (
        {
            "en": "How physically demanding was the task?",
            "es": "¿Qué exigencia física tuvo la tarea?",
            "de": "Wie hoch war die körperliche Anforderung der Aufgabe?",
            "fr": "À quel point la tâche était-elle exigeante physiquement ?",
        },
        _LOW,
        _HIGH,
    ),
    (
        {
            "en": "How hurried or rushed was the pace of the task?",
            "es": "¿Qué prisa imponía el ritmo de la tarea?",
            "de": "Wie hoch war der Zeitdruck bei der Aufgabe?",
            "fr": "À quel point le rythme de la tâche était-il pressé ?",
        },
        _LOW,
        _HIGH,
    ),
    (
        {
            "en": "How successful were you in accomplishing what you were asked to do?",
            "es": "¿Cómo de bien logró lo que se le pidió?",
            "de": "Wie gut ist Ihnen gelungen, worum Sie gebeten wurden?",
            "fr": "Dans quelle mesure avez-vous réussi ce qui vous était demandé ?",
        },
        _PERFECT,
        _FAILURE,
    ),
    (
        {
            "en": "How hard did you have to work to accomplish your level of performance?",
            "es": "¿Cuánto tuvo que esforzarse para lograr su resultado?",
            "de": "Wie sehr mussten Sie sich anstrengen, um das zu erreichen?",
            "fr": "À quel point avez-vous dû faire des efforts pour y arriver ?",
        },
        _LOW,
        _HIGH,
    ),
    (
        {
            "en": "How insecure, discouraged, irritated, stressed, and annoyed were you?",
            "es": "¿Qué inseguridad, desánimo, irritación, estrés o enfado sintió?",
            "de": "Wie unsicher, entmutigt, gereizt, gestresst oder verärgert waren Sie?",
            "fr": "À quel point vous êtes-vous senti peu sûr, découragé, irrité, stressé, agacé ?",
        },
        _LOW,
        _HIGH,
    ),
)
_AGREEMENT_INTRO: Words = {
    "en": "How much do you agree?",
    "es": "¿Está de acuerdo?",
    "de": "Wie sehr stimmen Sie zu?",
    "fr": "Êtes-vous d’accord ?",
}
_TASK_INTRO: Words = {
    "en": "Think of the walking that you have just done.",
    "es": "Piense en la marcha que acaba de hacer.",
    "de": "Denken Sie an das Gehen von eben.",
    "fr": "Pensez à la marche que vous venez de faire.",
}
SHIPPED = {"sus": "System Usability Scale (SUS)", "tlx": "NASA-TLX (raw)"}


def shipped_instrument(slug: str, language: str) -> Instrument:
    """Return a questionnaire in a language, or else in English. Raises KeyError for no slug."""
    title = SHIPPED[slug]
    language = language if language in _AGREE else ENGLISH
    validated = language == ENGLISH
    if slug == "sus":
        return Instrument(
            slug,
            title,
            _AGREEMENT_INTRO[language],
            language,
            tuple(
                Item(words[language], _DISAGREE[language], _AGREE[language], 5)
                for words in _SUS_ITEMS
            ),
            "Brooke, J. (1996). SUS: a “quick and dirty” usability scale. In Usability Evaluation "
            "in Industry. Taylor & Francis, 189–194.",
            "Copyright Digital Equipment Corporation, 1986. Free to use with the source named.",
            validated,
            Scoring.SUS,
        )
    return Instrument(
        slug,
        title,
        _TASK_INTRO[language],
        language,
        tuple(
            Item(words[language], low[language], high[language], 21, 0, 5)
            for words, low, high in _TLX_ITEMS
        ),
        "Hart, S. G., & Staveland, L. E. (1988). Development of NASA-TLX. Advances in Psychology "
        "52, 139–183; NASA Ames Research Center. Unweighted: Hart, S. G. (2006).",
        "A work of the United States government: in the public domain.",
        validated,
        Scoring.MEAN,
    )
