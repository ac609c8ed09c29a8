//! Which character set the bytes of a text are in, where nobody says it.
//!
//! GB 18030 gives a Chinese character for almost any two bytes, so that Japanese and Korean texts become Chinese ones without a fault. What
//! tells the sets apart is which characters come out: those that people write, or rare ones. Of each set that the bytes fit, the
//! characters that are frequent in its language are counted; the set with the greatest share is taken if that share is large enough and no other
//! set comes near. Else the set is not known, and the bytes stay bytes.
//!
//! Limits: a text of one or two rare characters is not told. Big5, EUC-JP and the sets of the West are never found, only named.

use encoding_rs::{EUC_KR, Encoding, GB18030, SHIFT_JIS};

/// At least so large a share of the characters beyond ASCII is frequent in the language. Of a text in another set about one in seven is
/// frequent by chance (600 of some 4,000 characters); of a real one four in five are.
const SHARE_MIN: f64 = 0.34;

/// The runner-up has at most this part of the winner's share.
const NEAR: f64 = 0.75;

/// Frequent signs of Chinese: of the shop first, then of the language.
const CHINESE: &str = "主轴转速进给率功电流压温度时间日期切削深宽工件刀具程序冷却液备注状态力扭矩批次试验机床号数值最大小平均报警运行倍负载位置\
信息正常急停钻孔攻丝铣车磨镗铰粗精加工面外圆内端槽齿轮叶套盖板壳体法兰阀泵螺纹左右上下前后中心夹头顶尖尾座油气门开关启动止停循环单段手自动回零点参考\
坐标系偏补偿长径半角换库臂盘料毛坯成品检测量具图纸版本客户公司名称编码代测试调修改完成错误故障请检查系统伺服驱动过热超程限警告提示操作员班组检验合格不\
的一是了在有和人这为以要到说对能可出会生来用去行下子所种方法于作多年就分们学那你我他地得着自之过家十用发天如然都还也好看起部建变只把现从意间样\
应该型设计制造高低快慢新旧第二三四五六七八九百千万个表格条件基准水平直线曲线斜倒角钢铝铜铁铸锻黑白红绿黄蓝色轻重";

/// Frequent signs of Japanese beside its syllables.
const JAPANESE: &str = "主軸回転数速度送電力流圧温日付時刻間経過工番号切削深込負荷平均最大小値測定加計名状態冷却油機械位置運記録単試験荒仕上中面外径内端溝穴\
明歯車軸部品素材原点補正長半角交換治具確認異常非停止開始終了自動手前後左右右低高新旧第一二三四五六七八九十百千万用図版客先検査合格不良";

/// Frequent syllables of Korean.
const KOREAN: &str = "가각간감강개거건검게격결경계고공과관교구국권규그금급기긴나내너네노다단당대더덕도동되된두드들등디따때또라락란래량러런레려력련로록료루류\
륜르름리링마막만말매면명모목무문물미및바박반발방배버번법변별보복본봉부북분비사산삭삼상색생서석선설성세소속손송수순스슬시식신실심아안알암압앙애야약양어언업에여역연열영예오온옵\
와완외용우운원위유육윤으은을음의이인일임입자작잔장재저적전절점접정제조종좌주준중증지직진질차착참창처천철청체초총최추축출충측치칭카커컷코크클타탈탭터테토통투트특팀파판패팬페편\
평포표품프플하학한할함합항해핸행향헤현형호홀화확환황회후휘휴흐히힌";

/// The bytes as a text in the set that they are in; `None` where that is not known.
pub(super) fn find_text(bytes: &[u8]) -> Option<String> {
    let mut found: Vec<Candidate> = SETS.iter().filter_map(|set| Candidate::read(set, bytes)).collect();
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    let mut ranked = found.into_iter();
    let best = ranked.next()?;
    let next = ranked.next().map_or(0.0, |next| next.share);
    (best.share >= SHARE_MIN && next <= NEAR * best.share).then_some(best.text)
}

struct KnownSet {
    encoding: &'static Encoding,
    is_frequent: fn(char) -> bool,
}

const SETS: [KnownSet; 3] = [
    KnownSet { encoding: GB18030, is_frequent: |sign| CHINESE.contains(sign) || is_wide_mark(sign) },
    KnownSet {
        encoding: SHIFT_JIS,
        is_frequent: |sign| JAPANESE.contains(sign) || is_kana(sign) || is_wide_mark(sign),
    },
    KnownSet { encoding: EUC_KR, is_frequent: |sign| KOREAN.contains(sign) || is_wide_mark(sign) },
];

/// Hiragana and katakana in full width. Those in half width are single bytes, which most Chinese texts consist of as well.
fn is_kana(sign: char) -> bool {
    ('\u{3041}'..='\u{30ff}').contains(&sign)
}

/// Punctuation and Latin letters in full width, which all of the sets have.
fn is_wide_mark(sign: char) -> bool {
    ('\u{3000}'..='\u{3011}').contains(&sign) || ('\u{ff01}'..='\u{ff5e}').contains(&sign)
}

struct Candidate {
    text: String,
    /// Share of the characters beyond ASCII that are frequent, 0 to 1.
    share: f64,
}

impl Candidate {
    fn read(set: &KnownSet, bytes: &[u8]) -> Option<Self> {
        let text = set.encoding.decode_without_bom_handling_and_without_replacement(bytes)?.into_owned();
        let (mut all, mut frequent) = (0_u32, 0_u32);
        for sign in text.chars().filter(|sign| !sign.is_ascii()) {
            all += 1;
            frequent += u32::from((set.is_frequent)(sign));
        }
        let share = f64::from(frequent) / f64::from(all.max(1));
        Some(Self { text, share })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHINESE_TEXTS: [&str; 12] = [
        "急停 1",
        "报警",
        "主轴过热",
        "精车外圆",
        "钻孔 D8",
        "法兰盖 粗车",
        "叶轮",
        "X轴超程",
        "请检查冷却液",
        "刀具寿命到",
        "第二序",
        "攻丝M8",
    ];
    const JAPANESE_TEXTS: [&str; 8] =
        ["荒加工", "仕上げ", "ドリル 8.5", "主軸オーバーヒート", "工具交換", "非常停止", "穴あけ", "タップ M8"];
    const KOREAN_TEXTS: [&str; 8] =
        ["황삭 가공", "정삭", "드릴 8.5", "공구 교환", "비상정지", "스핀들 과열", "탭 가공", "외경 황삭"];

    fn read_all(texts: &[&str], set: &'static Encoding) -> (usize, usize) {
        let read = |text: &&str| find_text(&set.encode(text).0).map(|found| found == **text);
        let all: Vec<Option<bool>> = texts.iter().map(read).collect();
        println!("{} {all:?}", set.name());
        (all.iter().filter(|one| **one == Some(true)).count(), all.iter().filter(|one| **one == Some(false)).count())
    }

    #[test]
    fn texts_of_a_shop_are_right_or_stay_bytes() {
        let chinese = read_all(&CHINESE_TEXTS, GB18030);
        let japanese = read_all(&JAPANESE_TEXTS, SHIFT_JIS);
        let korean = read_all(&KOREAN_TEXTS, EUC_KR);
        assert_eq!((chinese.1, japanese.1, korean.1), (0, 0, 0), "none is wrong");
        assert!(chinese.0 >= 11 && japanese.0 >= 7 && korean.0 >= 7, "{chinese:?} {japanese:?} {korean:?}");
    }

    #[test]
    fn a_text_of_the_west_does_not_become_a_chinese_one() {
        for text in ["Gehäuse", "Kühlung", "Welle Ø20", "pièce nº 4", "Größe", "Übermaß"] {
            assert_eq!(find_text(&encoding_rs::WINDOWS_1252.encode(text).0), None, "{text}");
        }
    }

    proptest::proptest! {
        /// Any words of one of the languages, joined in any order, are read as that language or not at all.
        #[test]
        fn words_of_a_language_are_never_read_as_another(
            picks in proptest::collection::vec(0_usize..64, 1..6), language in 0_usize..3,
        ) {
            let (texts, set): (&[&str], _) = match language {
                0 => (&CHINESE_TEXTS, GB18030),
                1 => (&JAPANESE_TEXTS, SHIFT_JIS),
                _ => (&KOREAN_TEXTS, EUC_KR),
            };
            let text = picks.iter().map(|pick| texts[pick % texts.len()]).collect::<Vec<_>>().join(" ");
            let found = find_text(&set.encode(&text).0);
            proptest::prop_assert!(found.is_none() || found.as_deref() == Some(text.as_str()), "{text}: {found:?}");
        }
    }
}
