using Handcal;
using UnityEngine;

/// <summary>
/// Opens the keyboard while the headset is not paired, for the PC's address and digits
/// ("192.168.1.20:47800 12345678") or the text under its QR code.
/// </summary>
public sealed class PairByTyping : MonoBehaviour
{
    public HandcalHeadset headset;
    TouchScreenKeyboard keyboard;

    void Start()
    {
        if (!headset.IsPaired) Ask();
    }

    /// <summary>Opens the keyboard, also to pair again: call it from a button.</summary>
    public void Ask()
    {
        keyboard = TouchScreenKeyboard.Open("");
    }

    void Update()
    {
        if (keyboard == null || keyboard.status != TouchScreenKeyboard.Status.Done) return;
        string text = keyboard.text;
        keyboard = null;
        if (!headset.Pair(text)) Ask();
    }
}
